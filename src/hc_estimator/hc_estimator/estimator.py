"""The estimator that users hold: settings, memory and a compiled filter behind a small interface.

`step` and `run` go through the same compiled loop, `step` with one sample; their numbers are
therefore the same to the last bit.
"""

from __future__ import annotations

import math
from collections.abc import Container, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hc_estimator import recovery, screening
from hc_estimator.adaptation import policy
from hc_estimator.compilation import compiled
from hc_estimator.contact import registry as contact_registry
from hc_estimator.contact.registry import CONTACT_MODELS
from hc_estimator.estimate import COLUMNS, Estimate, EstimateSeries
from hc_estimator.filters.registry import FIELDS, FILTERS, HIDDEN_SPECIFICATIONS, SCRATCH
from hc_estimator.given_arrays import as_numbers
from hc_estimator.kinds import (
    DEFAULT_CONTACT_MODEL,
    DEFAULT_STATE_SPACE,
    parameter_specifications,
)
from hc_estimator.late_readings import LateReadings
from hc_estimator.memory import Field, from_plain, record_type, to_plain
from hc_estimator.specification import (
    ParameterSpecification,
    ParameterValue,
    checked_values,
)
from hc_estimator.state_space import registry as state_space_registry
from hc_estimator.state_space.registry import STATE_SPACES

STATE_FORMAT = 56  # of Estimator.state(); raised when its meaning changes


def _all_specifications() -> dict[str, ParameterSpecification]:
    """Every parameter of the package once; the settings record has a field for each."""
    result: dict[str, ParameterSpecification] = {}
    groups = [entry.specifications for entry in FILTERS.values()]
    groups += state_space_registry.SPECIFICATIONS.values()
    groups += contact_registry.SPECIFICATIONS.values()
    groups += [screening.SPECIFICATIONS, HIDDEN_SPECIFICATIONS]
    for group in groups:
        for specification in group:
            result.setdefault(specification.name, specification)
    return result


_ALL_SPECIFICATIONS = _all_specifications()
SETTINGS = record_type(
    (
        Field("state_space", np.int64),
        Field("contact_model", np.int64),
        *(
            Field(name, np.float64 if specification.kind in ("float", "auto") else np.int64)
            for name, specification in _ALL_SPECIFICATIONS.items()
        ),
    )
)
MEMORY = record_type(FIELDS + SCRATCH)


@compiled
def _initialise(settings_array: Any, memory_array: Any) -> None:
    recovery.reset(settings_array[0], memory_array[0])


@compiled
def _set_noise(settings_array: Any, memory_array: Any) -> None:
    for i in range(2):
        policy.set_noise(settings_array[0], memory_array[0], i)


def last_time(memory: Any) -> float:
    """Stamp [s] of the last sample that a memory record has used."""
    clock = memory if memory.dtype == MEMORY else memory["clock"]
    return float(clock["last_time"])


class Estimator:
    """Estimates the contact parameters from samples of displacement and force.

    Make one with `create_estimator`. Units: mm, mm/s, N, s. Not safe for use from several threads
    at once.
    """

    def __init__(
        self,
        filter: str,
        state_space: str,
        contact_model: str,
        parameters: Mapping[str, object],
    ) -> None:
        self._filter = filter
        self._state_space = state_space
        self._contact_model = contact_model
        self._specifications = parameter_specifications(
            filter, state_space, contact_model, internal=parameters
        )
        values = {s.name: s.default for s in self._specifications}
        values.update(checked_values(self._specifications, parameters))
        self._values: dict[str, ParameterValue] = values
        self._run = FILTERS[filter].run
        self._settings = np.zeros(1, SETTINGS)
        for name, specification in _ALL_SPECIFICATIONS.items():
            self._settings[name] = specification.encoded(specification.default)
        every = parameter_specifications(
            filter, state_space, contact_model, internal=FILTERS[filter].internal
        )
        for specification in every:
            self._settings[specification.name] = specification.encoded(specification.default)
        for name, value in FILTERS[filter].fixed.items():
            self._settings[name] = _ALL_SPECIFICATIONS[name].encoded(value)
        self._settings["state_space"] = STATE_SPACES.index(state_space)
        self._settings["contact_model"] = CONTACT_MODELS.index(contact_model)
        entry = FILTERS[filter]
        self._fields = FIELDS if entry.memory is None else entry.memory
        self._memory_type = MEMORY if entry.memory is None else record_type(entry.memory)
        self._initialise = entry.initialise or _initialise
        self._set_noise = entry.set_noise or _set_noise
        self._take_settings = entry.take_settings
        self._late = _late_readings(values)
        self._memory = np.zeros(1, self._memory_type)
        self._particles = np.zeros(entry.particle_shape(int(values.get("particle_count", 0))))
        self._sample = np.zeros((1, 3))
        self._row = np.zeros((1, COLUMNS))
        self._write_settings(values)
        self.reset()

    def __repr__(self) -> str:
        kind = f"{self._filter!r}, state_space={self._state_space!r}"
        values = [
            f"{s.name}={self._values[s.name]!r}"
            for s in self._specifications
            if self._values[s.name] != s.default
        ]
        given = ", ".join((f"contact_model={self._contact_model!r}", *values))
        return f"create_estimator({kind}, {given})"

    @property
    def filter(self) -> str:
        """Name of the filter."""
        return self._filter

    @property
    def state_space(self) -> str:
        """Name of the state space."""
        return self._state_space

    @property
    def contact_model(self) -> str:
        """Name of the contact model."""
        return self._contact_model

    @property
    def specifications(self) -> tuple[ParameterSpecification, ...]:
        """The parameters that this estimator has."""
        return self._specifications

    @property
    def configuration(self) -> dict[str, ParameterValue]:
        """Every parameter's value in force, by name.

        `create_estimator(e.filter, state_space=e.state_space, contact_model=e.contact_model,
        **e.configuration)` makes an equal estimator.
        """
        return dict(self._values)

    def step(self, time_s: float, displacement_mm: float | None, force_n: float | None) -> Estimate:
        """Use one sample.

        Never raises on data: `rejected` of the estimate says why a sample was not used.

        Args:
            time_s: stamp [s].
            displacement_mm: penetration [mm], positive into the tissue. With the parameter
                `missing_readings` None or NaN if there is none at this stamp.
            force_n: contact force [N], compression positive; None or NaN as above.

        Returns:
            The estimate after this sample.

        Raises:
            TypeError: one of them is not a number, but an array, say.
        """
        readings = (math.nan if r is None else r for r in (displacement_mm, force_n))
        given = (time_s, *readings)
        try:
            self._sample[0] = given
        except OverflowError:  # no float is so large
            self._sample[0] = as_numbers("step", given)
        except (TypeError, ValueError) as error:
            raise TypeError(f"step takes three numbers, run takes arrays: {error}") from None
        self._use(self._sample, self._row)
        return Estimate(self._row[0].copy())

    def run(
        self, time_s: ArrayLike, displacement_mm: ArrayLike, force_n: ArrayLike
    ) -> EstimateSeries:
        """Use many samples; the same as `step` for each, in one compiled loop.

        A sample takes about 300 bytes in the result. Long recordings can be given in pieces, one
        call after another: the numbers are the same.

        Args:
            time_s: stamps [s], shape (samples,).
            displacement_mm: penetration [mm], shape (samples,); NaN as in `step`, and so is
                what is masked.
            force_n: contact force [N], shape (samples,); NaN as in `step`.

        Returns:
            The estimates after each sample.

        Raises:
            ValueError: the arrays are not one-dimensional or differ in length.
            TypeError: one holds dates, durations or what is no number.
        """
        given = {"time_s": time_s, "displacement_mm": displacement_mm, "force_n": force_n}
        columns = [as_numbers(name, values) for name, values in given.items()]
        shapes = [c.shape for c in columns]
        if len(set(shapes)) != 1 or len(shapes[0]) != 1:
            raise ValueError(
                "time_s, displacement_mm and force_n have the shapes "
                f"{', '.join(map(str, shapes))}: give three one-dimensional arrays of one length"
            )
        samples = np.ascontiguousarray(np.stack(columns, axis=1))
        rows = np.empty((samples.shape[0], COLUMNS))
        self._use(samples, rows)
        return EstimateSeries(rows)

    def _use(self, samples: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        """Use samples, shape (samples, 3), and fill their rows."""
        if self._late is None:
            self._use_in_order(samples, rows)
        else:
            self._late.run(
                self._use_in_order, self._memory, self._particles, self._last_time, samples, rows
            )

    def _use_in_order(self, samples: NDArray[np.float64], rows: NDArray[np.float64]) -> None:
        self._run(self._settings, self._memory, self._particles, samples, rows)

    def _last_time(self) -> float:
        return last_time(self._memory[0])

    def reset(self) -> None:
        """Forget all samples; the parameters stay."""
        self._memory[:] = np.zeros(1, self._memory_type)
        self._particles[:] = 0.0
        if self._late is not None:
            self._late.forget()
        self._initialise(self._settings, self._memory)

    def reconfigure(self, **parameters: object) -> None:
        """Change parameters while running, all of them or, on an error, none.

        Raises:
            ValueError: a parameter is unknown, out of range or fixed while running; the message
                names it, its value and what is allowed.
        """
        values = checked_values(self._specifications, parameters, runtime_only=True)
        self._values.update(values)
        self._write_settings(values)
        # A late reading goes back to a memory of before, in which they must hold as well.
        before = [] if self._late is None else self._late.memories
        for memory in (self._memory, *before):
            self._take_into(memory, values)

    def _take_into(self, memory: NDArray[Any], values: Container[str]) -> None:
        """Take what a memory holds of settings, of which those named have changed."""
        if "displacement_noise_std" in values or "force_noise_std" in values:
            self._set_noise(self._settings, memory)
        if self._take_settings is not None:
            self._take_settings(self._settings, memory)

    def warm_up(self) -> None:
        """Compile (or load from the cache) what `step` and `reconfigure` need; the state stays."""
        nothing = np.zeros((0, 3))
        self._set_noise(self._settings, self._memory.copy())
        self._run(self._settings, self._memory, self._particles, nothing, np.zeros((0, COLUMNS)))

    def state(self) -> dict[str, Any]:
        """Everything the estimator knows, as plain data (numbers, texts, lists, dicts).

        `restore` on an estimator of the same filter, state space and contact model continues from
        it to the last bit, but does not go back before it for a reading that comes late
        (`reorder_window`). Survives JSON.
        """
        return {
            **self.state_without_memory(),
            "memory": to_plain(self._memory[0], self._fields),
            "particles": FILTERS[self._filter].kept_particles(self._particles).tolist(),
        }

    def state_without_memory(self) -> dict[str, Any]:
        """Of `state` what says whose it is; the rest by `packed_state.freeze` where it is large."""
        return {
            "format": STATE_FORMAT,
            "filter": self._filter,
            "state_space": self._state_space,
            "contact_model": self._contact_model,
            "configuration": self.configuration,
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Continue from what `state` returned, configuration included.

        Args:
            state: what `state()` of an estimator of the same kind returned.

        Raises:
            ValueError: it belongs to another kind of estimator or is not complete.
        """
        expected = {
            "format": STATE_FORMAT,
            "filter": self._filter,
            "state_space": self._state_space,
            "contact_model": self._contact_model,
        }
        for name, value in expected.items():
            if state.get(name) != value:
                raise ValueError(
                    f"cannot restore a state with {name} = {state.get(name)!r}: "
                    f"this estimator has {value!r}"
                )
        memory = np.zeros(1, self._memory_type)
        try:
            if not isinstance(state["configuration"], Mapping):
                raise ValueError("the configuration holds no names and values")
            values = checked_values(self._specifications, state["configuration"])
            missing = [s.name for s in self._specifications if s.name not in values]
            if missing:
                raise ValueError(f"no value for {', '.join(missing)}")
            from_plain(state["memory"], self._fields, memory[0])
            particles = self._restored_particles(state["particles"], values)
        except (KeyError, TypeError, ValueError, OverflowError) as error:
            raise ValueError(f"cannot restore an incomplete or damaged state: {error}") from error
        self._values = values
        self._write_settings(values)
        self._memory[:] = memory
        self._particles = particles
        self._late = _late_readings(values)

    def _restored_particles(
        self, saved: Any, values: Mapping[str, ParameterValue]
    ) -> NDArray[np.float64]:
        entry = FILTERS[self._filter]
        particles = np.zeros(entry.particle_shape(int(values.get("particle_count", 0))))
        kept = entry.kept_particles(particles)
        if kept.size:
            given = np.asarray(saved, np.float64)
            if given.shape != kept.shape:
                raise ValueError(f"particles have shape {given.shape} not {kept.shape}")
            kept[...] = given
        return particles

    def _write_settings(self, values: Mapping[str, ParameterValue]) -> None:
        for specification in self._specifications:
            if specification.name in values:
                encoded = specification.encoded(values[specification.name])
                self._settings[specification.name] = encoded


def _late_readings(values: Mapping[str, ParameterValue]) -> LateReadings | None:
    """What puts late readings in their place, if the settings ask for it."""
    window = float(values["reorder_window"]) if values["missing_readings"] else 0.0
    return LateReadings(window) if window > 0.0 else None


def create_estimator(
    filter: str,
    *,
    state_space: str = DEFAULT_STATE_SPACE,
    contact_model: str = DEFAULT_CONTACT_MODEL,
    **parameters: object,
) -> Estimator:
    """Make an estimator.

    Args:
        filter: one of `available_filters()`.
        state_space: one of `available_state_spaces(filter)`.
        contact_model: one of `available_contact_models()`.
        **parameters: values by name, see `parameter_specifications`.

    Returns:
        The estimator, ready for the first sample.

    Raises:
        ValueError: an unknown name or a value out of its range; the message names the parameter,
            its value and what is allowed.
    """
    return Estimator(filter, state_space, contact_model, parameters)
