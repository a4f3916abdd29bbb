"""Many estimates as one hc_msgs/HuntCrossleyEstimates, from the rows of the estimator to bytes.

At 4 kHz such a message is made a thousand times a second, of four estimates with 59 numbers each:
one gathering assignment for all numbers, instead of one for each of forty fields.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from hc_msgs.msg import HuntCrossleyEstimates
from numpy.typing import NDArray

from hc_estimator.estimate import (
    CHANGE_DETECTED,
    CHANNEL_DELAY,
    CHANNEL_DELAY_STD,
    COLUMNS,
    CONTACT,
    CONTACT_POSITION,
    CONTACT_POSITION_STD,
    COVARIANCE,
    DISPLACEMENT,
    DISPLACEMENT_NOISE_STD,
    FORCE_NOISE_STD,
    FORCE_PREDICTED,
    FORCE_RECONSTRUCTED,
    FORCE_ZERO,
    FORCE_ZERO_STD,
    HYPOTHESIS,
    HYPOTHESIS_SCORES,
    IDENTIFIABILITY,
    INNOVATION,
    MODEL_MISMATCH,
    NIS,
    PARAMETERS,
    REJECTED,
    VELOCITY,
)
from hc_estimator.stream.vocabulary import Batch
from hc_msgs_py.cdr import HEAD
from hc_msgs_py.estimate_fields import PARAMETERS as PARAMETER_FIELDS
from hc_msgs_py.topics import FRAME_INDENTER_TIP
from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire_arrays import ArraysEncoder

_DEVIATIONS: Final = COLUMNS
"""Columns behind those of a row: the four standard deviations, made of the covariance."""
_NUMBERS: Final[dict[str, tuple[int, int, float]]] = {
    **{name: (PARAMETERS + i, 1, 1.0) for i, name in enumerate(PARAMETER_FIELDS)},
    **{f"{name}_std": (_DEVIATIONS + i, 1, 1.0) for i, name in enumerate(PARAMETER_FIELDS)},
    **{
        f"{name}_identifiability": (IDENTIFIABILITY + i, 1, 1.0)
        for i, name in enumerate(PARAMETER_FIELDS)
    },
    "displacement": (DISPLACEMENT, 1, METRE_IN_MM),
    "velocity": (VELOCITY, 1, METRE_IN_MM),
    "force_predicted": (FORCE_PREDICTED, 1, 1.0),
    "force_reconstructed": (FORCE_RECONSTRUCTED, 1, 1.0),
    "innovation_displacement": (INNOVATION, 1, METRE_IN_MM),
    "innovation_force": (INNOVATION + 1, 1, 1.0),
    "nis": (NIS, 1, 1.0),
    "force_noise_std": (FORCE_NOISE_STD, 1, 1.0),
    "displacement_noise_std": (DISPLACEMENT_NOISE_STD, 1, METRE_IN_MM),
    "channel_delay": (CHANNEL_DELAY, 1, 1.0),
    "channel_delay_std": (CHANNEL_DELAY_STD, 1, 1.0),
    "contact_position": (CONTACT_POSITION, 1, METRE_IN_MM),
    "contact_position_std": (CONTACT_POSITION_STD, 1, METRE_IN_MM),
    "force_zero": (FORCE_ZERO, 1, 1.0),
    "force_zero_std": (FORCE_ZERO_STD, 1, 1.0),
    "covariance": (COVARIANCE, 16, 1.0),
    "hypothesis_scores": (HYPOTHESIS_SCORES, 6, 1.0),
}
"""Of each field of doubles: its first column, how many an estimate, what divides them."""
_CODES: Final = {
    "contact": CONTACT,
    "change_detected": CHANGE_DETECTED,
    "model_mismatch": MODEL_MISMATCH,
    "rejected": REJECTED,
    "hypothesis": HYPOTHESIS,
}
"""Fields of a byte an estimate: flags, which are 0 or 1 in a row, and codes."""
_COLUMNS: Final = np.concatenate([np.arange(at, at + n) for at, n, _ in _NUMBERS.values()])
_DIVISORS: Final = np.concatenate([np.full(n, divisor) for _, n, divisor in _NUMBERS.values()])
_CODE_COLUMNS: Final = np.array(list(_CODES.values()))


class _Places(NamedTuple):
    """A message for so many estimates: its record, and where in its bytes the numbers go.

    Attributes:
        record: shape (1,), to be filled.
        doubles: its bytes from the end of the encapsulation on, as doubles.
        bytes: the record's bytes.
        numbers: (count, numbers) places among the doubles.
        codes: (count, codes) places among the bytes.
    """

    record: NDArray[Any]
    doubles: NDArray[np.float64]
    bytes: NDArray[np.uint8]
    numbers: NDArray[np.int64]
    codes: NDArray[np.int64]


class EstimateArraysEncoder:
    """Makes HuntCrossleyEstimates messages; the frame is the same until it is changed."""

    def __init__(self, frame_id: str = FRAME_INDENTER_TIP) -> None:
        self._encoder = ArraysEncoder(HuntCrossleyEstimates, frame_id)
        self._places: dict[int, _Places] = {}

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the messages made from now on."""
        self._encoder.set_frame(frame_id)
        self._places.clear()

    def encode(
        self,
        batch: Batch,
        rows: NDArray[np.float64],
        configuration_revision: int,
        computation_time_s: float,
        latency_s: float,
    ) -> bytes:
        """Return estimates as a serialised HuntCrossleyEstimates, in SI but for the parameters.

        Args:
            batch: the samples, no more than a message holds (hc_msgs_py.wire_arrays).
            rows: their estimates (`EstimateSeries.values`), shape (samples, COLUMNS).
            configuration_revision: in force.
            computation_time_s: of all of them.
            latency_s: of the last one.
        """
        count = len(rows)
        first_ns = int(batch.stamps_ns[0])
        record = self._encoder.record(count, first_ns)
        places = self._places.get(count)
        if places is None or places.record is not record:
            places = self._places[count] = _places_of(record, count)
        record["configuration_revision"] = configuration_revision
        record["computation_time"] = computation_time_s
        record["latency"] = latency_s
        record["time_offset"] = batch.stamps_ns - first_ns
        record["sequence"] = batch.sequences
        record["force_measured"] = batch.forces_n
        deviations = np.sqrt(rows[:, COVARIANCE : COVARIANCE + 16 : 5])
        columns = np.concatenate((rows, deviations), axis=1)
        places.doubles[places.numbers] = columns[:, _COLUMNS] / _DIVISORS
        places.bytes[places.codes] = rows[:, _CODE_COLUMNS]
        return record.tobytes()


def _places_of(record: NDArray[Any], count: int) -> _Places:
    data = record.view(np.uint8)
    whole = HEAD + (len(data) - HEAD) // 8 * 8
    fields: Any = record.dtype.fields
    each = np.arange(count)[:, None]
    numbers = [
        (fields[name][1] - HEAD) // 8 + each * width + np.arange(width)
        for name, (_, width, _) in _NUMBERS.items()
    ]
    codes = [fields[name][1] + each for name in _CODES]
    return _Places(
        record,
        data[HEAD:whole].view(np.float64),
        data,
        np.concatenate(numbers, axis=1),
        np.concatenate(codes, axis=1),
    )
