"""What an estimator answers: the estimate after one sample, or the series after many.

Both are views of rows of numbers that the compiled kernels fill; the positions stand here once,
for the kernels and for the readers.
"""

from __future__ import annotations

import enum
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

# Columns of a row.
PARAMETERS = 0  # 4: K, B, n, p
COVARIANCE = 4  # 16: row-major 4x4
FORCE_PREDICTED = 20
FORCE_RECONSTRUCTED = 21
INNOVATION = 22  # 2: displacement, force
NIS = 24
IDENTIFIABILITY = 25  # 4
DISPLACEMENT = 29
VELOCITY = 30
FORCE_NOISE_STD = 31
DISPLACEMENT_NOISE_STD = 32
CONTACT = 33
CHANGE_DETECTED = 34
MODEL_MISMATCH = 35
REJECTED = 36
PROCESS_NOISE_SCALE = 37
CHANNEL_DELAY = 38
CHANNEL_DELAY_STD = 39
CONTACT_POSITION = 40
CONTACT_POSITION_STD = 41
FORCE_ZERO = 42
FORCE_ZERO_STD = 43
HYPOTHESIS = 44
HYPOTHESIS_SCORES = 45  # 6, in the order of Hypothesis
COLUMNS = 51

PARAMETER_NAMES = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


class Rejection(enum.IntEnum):
    """Why a sample was not used; the numbers of hc_msgs/HuntCrossleyEstimate."""

    ACCEPTED = 0
    NOT_FINITE = 1
    TIME_REPEATED = 2
    TIME_BACKWARD = 3
    OUTLIER = 4
    OUT_OF_RANGE = 5
    NUMERICAL = 6


class Hypothesis(enum.IntEnum):
    """What the tissue does, in the estimate that is given out; numbers as in the message."""

    CONSTANT = 0
    CONSTANT_FITTED = 1
    STIFFNESS_TREND = 2
    ALL_DRIFT = 3
    CHANGED = 4
    SURFACE_MOVES = 5


_REJECTIONS = tuple(Rejection)  # a look into a tuple is ten times faster than Rejection(code)
_HYPOTHESES = tuple(Hypothesis)


class _Rows:
    """Array-valued columns, common to one row (shape (COLUMNS,)) and many ((samples, COLUMNS))."""

    __slots__ = ("_rows",)

    def __init__(self, rows: NDArray[np.float64]) -> None:
        self._rows = rows

    @property
    def parameters(self) -> NDArray[np.float64]:
        """K [N/mm^n], B [N (s/mm)^p / mm^n], n [1], p [1], shape (..., 4)."""
        return self._rows[..., PARAMETERS : PARAMETERS + 4]

    @property
    def covariance(self) -> NDArray[np.float64]:
        """Covariance of the parameters in the same order and units, shape (..., 4, 4)."""
        block = self._rows[..., COVARIANCE : COVARIANCE + 16]
        return block.reshape((*block.shape[:-1], 4, 4))

    @property
    def parameters_std(self) -> NDArray[np.float64]:
        """Standard deviations of the parameters, shape (..., 4)."""
        deviations: NDArray[np.float64] = np.sqrt(self._rows[..., COVARIANCE : COVARIANCE + 16 : 5])
        return deviations

    @property
    def innovation(self) -> NDArray[np.float64]:
        """Measured minus predicted displacement [mm] and force [N], shape (..., 2).

        NaN where the sample was rejected before a prediction was made.
        """
        return self._rows[..., INNOVATION : INNOVATION + 2]

    @property
    def identifiability(self) -> NDArray[np.float64]:
        """How much the data said about each parameter, 0 (nothing) to 1 (all), shape (..., 4).

        It is 1 - posterior variance / prior variance, in the coordinates of the state space
        (ln K and ln B for `kinematic`), clipped to 0..1. A parameter held fixed has 0.
        """
        return self._rows[..., IDENTIFIABILITY : IDENTIFIABILITY + 4]

    @property
    def hypothesis_scores(self) -> NDArray[np.float64]:
        """RMS force error [N] of each `Hypothesis` some time ahead, shape (..., 6).

        NaN for hypotheses that the filter does not have.
        """
        return self._rows[..., HYPOTHESIS_SCORES : HYPOTHESIS_SCORES + 6]


class Estimate(_Rows):
    """The estimate after one sample. Lengths in mm, forces in N, times in s."""

    __slots__ = ("_values",)

    def __init__(self, row: NDArray[np.float64]) -> None:
        super().__init__(row)
        # One conversion of the row costs less than one of each number asked for.
        self._values: list[float] = row.tolist()

    @property
    def values(self) -> list[float]:
        """The whole row, by the columns named in `hc_estimator.estimate`; not to be changed."""
        return self._values

    @property
    def force_predicted(self) -> float:
        """Force [N] expected before the sample was used; NaN if it was rejected unseen."""
        return self._values[FORCE_PREDICTED]

    @property
    def force_reconstructed(self) -> float:
        """Force [N] after the update: of the contact law, or the mean given law and sensor."""
        return self._values[FORCE_RECONSTRUCTED]

    @property
    def nis(self) -> float:
        """Normalised innovation squared; mean 2 in a consistent filter; NaN if rejected unseen."""
        return self._values[NIS]

    @property
    def displacement(self) -> float:
        """Filtered penetration [mm]."""
        return self._values[DISPLACEMENT]

    @property
    def velocity(self) -> float:
        """Filtered velocity [mm/s]."""
        return self._values[VELOCITY]

    @property
    def force_noise_std(self) -> float:
        """Standard deviation [N] of the force noise in use, model error included."""
        return self._values[FORCE_NOISE_STD]

    @property
    def displacement_noise_std(self) -> float:
        """Standard deviation [mm] of the displacement noise in use."""
        return self._values[DISPLACEMENT_NOISE_STD]

    @property
    def channel_delay(self) -> float:
        """By how much the force is late [s]: F(t) belongs to d(t - channel_delay)."""
        return self._values[CHANNEL_DELAY]

    @property
    def channel_delay_std(self) -> float:
        """Standard deviation [s] of `channel_delay`; NaN where it is not estimated."""
        return self._values[CHANNEL_DELAY_STD]

    @property
    def contact_position(self) -> float:
        """Displacement reading [mm] at which the tool touches the tissue."""
        return self._values[CONTACT_POSITION]

    @property
    def contact_position_std(self) -> float:
        """Standard deviation [mm] of `contact_position`; NaN where it is not estimated."""
        return self._values[CONTACT_POSITION_STD]

    @property
    def force_zero(self) -> float:
        """Force reading [N] without contact."""
        return self._values[FORCE_ZERO]

    @property
    def force_zero_std(self) -> float:
        """Standard deviation [N] of `force_zero`; NaN where it is not estimated."""
        return self._values[FORCE_ZERO_STD]

    @property
    def process_noise_scale(self) -> float:
        """Factor by which an adaptation departs from the process noise of the settings."""
        return self._values[PROCESS_NOISE_SCALE]

    @property
    def contact(self) -> bool:
        """True while the filtered penetration is positive."""
        return self._values[CONTACT] != 0.0

    @property
    def change_detected(self) -> bool:
        """True at the sample where a change of the tissue was detected."""
        return self._values[CHANGE_DETECTED] != 0.0

    @property
    def model_mismatch(self) -> bool:
        """True while the contact law does not describe what the sensors say."""
        return self._values[MODEL_MISMATCH] != 0.0

    @property
    def rejected(self) -> Rejection:
        """Why the sample was not used; `Rejection.ACCEPTED` (0) if it was."""
        return _REJECTIONS[int(self._values[REJECTED])]

    @property
    def hypothesis(self) -> Hypothesis:
        """What the tissue does in this estimate; always CONSTANT from plain filters."""
        return _HYPOTHESES[int(self._values[HYPOTHESIS])]

    def __repr__(self) -> str:
        pairs = zip(PARAMETER_NAMES, self.parameters, self.parameters_std, strict=True)
        values = ", ".join(f"{name}={value:.6g}±{std:.2g}" for name, value, std in pairs)
        return f"Estimate({values}, nis={self.nis:.3g}, rejected={self.rejected.name})"


class EstimateSeries(_Rows):
    """The estimates after each of many samples: the names of `Estimate`, leading sample axis.

    Those of `EstimatorArray` lead with the axis of the channels.
    """

    __slots__ = ()

    @property
    def values(self) -> NDArray[np.float64]:
        """The whole rows, by the columns named in `hc_estimator.estimate`.

        Shape (samples, COLUMNS); not to be changed.
        """
        return self._rows

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return numbers and flags as arrays of shape (samples,), by names that have the unit.

        K, B, n, p under their own names are in N/mm^n, N (s/mm)^p / mm^n, 1 and 1; `rejected` holds
        the names of `Rejection` in lower case, empty for a sample that was used.
        """
        from hc_estimator.series_table import table_of  # which imports this module

        return table_of(self._rows)

    def to_dataframe(self, time_s: NDArray[np.float64] | None = None) -> Any:
        """Return `columns` as a pandas DataFrame, by time if it is given.

        Args:
            time_s: the samples' times [s], shape (samples,), for the index.

        Raises:
            ImportError: if pandas is not installed; the suite itself does not need it.
        """
        from hc_estimator.series_table import dataframe_of

        return dataframe_of(self._rows, time_s)

    def __repr__(self) -> str:
        count = len(self._rows)
        if not count:
            return "EstimateSeries(0 samples)"
        used = int(np.count_nonzero(self._rows[:, REJECTED] == 0.0))
        pairs = zip(PARAMETER_NAMES, self.parameters[-1], self.parameters_std[-1], strict=True)
        last = ", ".join(f"{name}={value:.6g}±{std:.2g}" for name, value, std in pairs)
        return f"EstimateSeries({count} samples, {used} used; last {last})"

    @property
    def force_predicted(self) -> NDArray[np.float64]:
        """Force [N] expected before each sample was used, shape (samples,); NaN as above."""
        return self._rows[..., FORCE_PREDICTED]

    @property
    def force_reconstructed(self) -> NDArray[np.float64]:
        """Force [N] after the update, as in `Estimate`, shape (samples,)."""
        return self._rows[..., FORCE_RECONSTRUCTED]

    @property
    def nis(self) -> NDArray[np.float64]:
        """Normalised innovation squared, shape (samples,); NaN where rejected unseen."""
        return self._rows[..., NIS]

    @property
    def displacement(self) -> NDArray[np.float64]:
        """Filtered penetration [mm], shape (samples,)."""
        return self._rows[..., DISPLACEMENT]

    @property
    def velocity(self) -> NDArray[np.float64]:
        """Filtered velocity [mm/s], shape (samples,)."""
        return self._rows[..., VELOCITY]

    @property
    def force_noise_std(self) -> NDArray[np.float64]:
        """Standard deviation [N] of the force noise in use, shape (samples,)."""
        return self._rows[..., FORCE_NOISE_STD]

    @property
    def displacement_noise_std(self) -> NDArray[np.float64]:
        """Standard deviation [mm] of the displacement noise in use, shape (samples,)."""
        return self._rows[..., DISPLACEMENT_NOISE_STD]

    @property
    def channel_delay(self) -> NDArray[np.float64]:
        """By how much the force is late [s], shape (samples,)."""
        return self._rows[..., CHANNEL_DELAY]

    @property
    def channel_delay_std(self) -> NDArray[np.float64]:
        """Standard deviation [s] of it, NaN where not estimated, shape (samples,)."""
        return self._rows[..., CHANNEL_DELAY_STD]

    @property
    def contact_position(self) -> NDArray[np.float64]:
        """Displacement reading [mm] where contact begins, shape (samples,)."""
        return self._rows[..., CONTACT_POSITION]

    @property
    def contact_position_std(self) -> NDArray[np.float64]:
        """Standard deviation [mm] of it, NaN where not estimated, shape (samples,)."""
        return self._rows[..., CONTACT_POSITION_STD]

    @property
    def force_zero(self) -> NDArray[np.float64]:
        """Force reading [N] without contact, shape (samples,)."""
        return self._rows[..., FORCE_ZERO]

    @property
    def force_zero_std(self) -> NDArray[np.float64]:
        """Standard deviation [N] of it, NaN where not estimated, shape (samples,)."""
        return self._rows[..., FORCE_ZERO_STD]

    @property
    def process_noise_scale(self) -> NDArray[np.float64]:
        """Factor by which an adaptation departs from the process noise, shape (samples,)."""
        return self._rows[..., PROCESS_NOISE_SCALE]

    @property
    def contact(self) -> NDArray[np.bool_]:
        """True while the filtered penetration is positive, shape (samples,)."""
        return self._flags(CONTACT)

    @property
    def change_detected(self) -> NDArray[np.bool_]:
        """True at the samples where a change of the tissue was detected, shape (samples,)."""
        return self._flags(CHANGE_DETECTED)

    @property
    def model_mismatch(self) -> NDArray[np.bool_]:
        """True while the contact law does not describe the sensors, shape (samples,)."""
        return self._flags(MODEL_MISMATCH)

    @property
    def rejected(self) -> NDArray[np.int64]:
        """Codes of `Rejection`, shape (samples,)."""
        return self._rows[..., REJECTED].astype(np.int64)

    @property
    def hypothesis(self) -> NDArray[np.int64]:
        """Codes of `Hypothesis`, shape (samples,)."""
        return self._rows[..., HYPOTHESIS].astype(np.int64)

    def _flags(self, column: int) -> NDArray[np.bool_]:
        flags: NDArray[np.bool_] = self._rows[..., column] != 0.0
        return flags

    def __len__(self) -> int:
        return int(self._rows.shape[0])

    @overload
    def __getitem__(self, index: int | np.integer[Any]) -> Estimate: ...
    @overload
    def __getitem__(self, index: slice | NDArray[Any] | list[Any]) -> EstimateSeries: ...
    def __getitem__(self, index: Any) -> Estimate | EstimateSeries:
        """Return the estimate after one sample, or the series of several, chosen as by numpy."""
        if type(index) is int:  # as of every sample of a stream
            return Estimate(self._rows[index])
        from hc_estimator.series_table import chosen_by

        rows = self._rows[chosen_by(index)]
        return Estimate(rows) if rows.ndim < self._rows.ndim else EstimateSeries(rows)
