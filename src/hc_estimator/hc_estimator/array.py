"""Many channels at once: tactile arrays and hands, with the numbers of one estimator each.

All channels have the same filter and settings and a memory of their own. One compiled call takes a
sample of every channel through the very kernels that `Estimator` uses, so that each channel's
numbers are those of an estimator of its own to the last bit, however many threads share the work.
"""

from __future__ import annotations

import itertools
from concurrent.futures import ThreadPoolExecutor
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hc_estimator.array_kernels import KERNELS
from hc_estimator.estimate import COLUMNS, EstimateSeries
from hc_estimator.estimator import Estimator, last_time
from hc_estimator.filters.registry import FILTERS
from hc_estimator.given_arrays import as_numbers
from hc_estimator.kinds import DEFAULT_CONTACT_MODEL, DEFAULT_STATE_SPACE
from hc_estimator.late_readings import LateReadings
from hc_estimator.series_table import chosen_by
from hc_estimator.specification import ParameterSpecification, ParameterValue

Array = NDArray[np.float64]
MOST_CHANNELS = 65_536
ARRAY_FILTERS = tuple(KERNELS)
"""The filters of the suite; one of another package has no loop over channels."""


class EstimatesOfChannels(EstimateSeries):
    """The estimates of many channels after each of many samples: axes (channels, samples, ...)."""

    __slots__ = ()

    @overload  # type: ignore[override]
    def __getitem__(self, index: int | np.integer[Any]) -> EstimateSeries: ...
    @overload
    def __getitem__(self, index: slice | NDArray[Any] | list[Any]) -> EstimatesOfChannels: ...
    def __getitem__(self, index: Any) -> EstimateSeries | EstimatesOfChannels:
        """Return the series of one of the channels, or of several, chosen as by numpy."""
        rows = self._rows[chosen_by(index)]
        return EstimateSeries(rows) if rows.ndim < self._rows.ndim else EstimatesOfChannels(rows)

    def __repr__(self) -> str:
        channels, samples, _columns = self._rows.shape
        return f"EstimatesOfChannels({channels} channels, {samples} samples)"


class EstimatorArray:
    """Estimates the contact parameters of many channels that are sampled together.

    Units: mm, mm/s, N, s. Not safe for use from several threads at once.

    Args:
        filter: one of `ARRAY_FILTERS`.
        channels: how many, 1 to 65,536.
        state_space: one of `available_state_spaces(filter)`.
        contact_model: one of `available_contact_models(filter)`.
        threads: that share the channels among them. With `missing_readings` and a
            `reorder_window` above 0 each channel can go back for readings of its own that come
            late; that is done one channel after the other, in one thread.
        **parameters: values by name for all channels, see `parameter_specifications`.

    Raises:
        ValueError: an unknown name or a value out of its range; the message names the parameter,
            its value and what is allowed.
    """

    def __init__(
        self,
        filter: str,
        channels: int,
        *,
        state_space: str = DEFAULT_STATE_SPACE,
        contact_model: str = DEFAULT_CONTACT_MODEL,
        threads: int = 1,
        **parameters: object,
    ) -> None:
        self._channels = _whole("channels", channels, MOST_CHANNELS)
        self._threads = min(_whole("threads", threads, 1024), self._channels)
        # Its settings and functions serve all channels, its memory before any sample is theirs.
        self._one = Estimator(filter, state_space, contact_model, parameters)
        if filter not in KERNELS:
            raise ValueError(
                f"filter = '{filter}' is of another package: make an estimator for each channel, "
                f"or take one of {', '.join(ARRAY_FILTERS)}"
            )
        self._kernel = KERNELS[filter]
        self._memories = np.repeat(self._one._memory, self._channels)
        self._particles = np.zeros((self._channels, *self._one._particles.shape))
        window = float(self.configuration["reorder_window"])
        late = bool(self.configuration["missing_readings"]) and window > 0.0
        self._late = [LateReadings(window) for _ in range(self._channels)] if late else []
        self._pool = self._new_pool()
        edges = np.linspace(0, self._channels, self._threads + 1).round().astype(int).tolist()
        self._shares = [slice(a, b) for a, b in itertools.pairwise(edges)]

    def _new_pool(self) -> ThreadPoolExecutor | None:
        if self._threads == 1 or self._late:
            return None
        return ThreadPoolExecutor(self._threads, "channels")

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy, or another process, goes on from; it has threads of its own."""
        return {name: value for name, value in vars(self).items() if name != "_pool"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._pool = self._new_pool()

    @property
    def channels(self) -> int:
        """How many channels there are."""
        return self._channels

    @property
    def filter(self) -> str:
        """Name of the filter."""
        return self._one.filter

    @property
    def state_space(self) -> str:
        """Name of the state space."""
        return self._one.state_space

    @property
    def contact_model(self) -> str:
        """Name of the contact model."""
        return self._one.contact_model

    @property
    def specifications(self) -> tuple[ParameterSpecification, ...]:
        """The parameters that the channels have."""
        return self._one.specifications

    @property
    def configuration(self) -> dict[str, ParameterValue]:
        """Every parameter's value in force, by name."""
        return self._one.configuration

    def step(
        self,
        time_s: ArrayLike,
        displacements_mm: ArrayLike | None,
        forces_n: ArrayLike | None,
    ) -> EstimateSeries:
        """Use one sample of every channel.

        Never raises on data: `rejected` of the estimates says why a sample was not used.

        Args:
            time_s: stamp [s], of all channels or shape (channels,).
            displacements_mm: penetrations [mm], shape (channels,). With the parameter
                `missing_readings` NaN for a channel without one, None if none has one.
            forces_n: contact forces [N], shape (channels,); NaN and None as above.

        Returns:
            The estimates after this sample; the leading axis is that of the channels.

        Raises:
            ValueError: an array has another shape.
        """
        samples = np.empty((self._channels, 1, 3))
        self._take(samples[:, 0, 0], "time_s", time_s, ((), (self._channels,)))
        for column, name, given in (
            (1, "displacements_mm", displacements_mm),
            (2, "forces_n", forces_n),
        ):
            if given is None:
                samples[:, 0, column] = np.nan
            else:
                self._take(samples[:, 0, column], name, given, ((self._channels,),))
        rows = np.empty((self._channels, 1, COLUMNS))
        self._use(samples, rows)
        return EstimateSeries(rows[:, 0])

    def run(
        self, time_s: ArrayLike, displacements_mm: ArrayLike, forces_n: ArrayLike
    ) -> EstimatesOfChannels:
        """Use many samples of every channel; the same as `step` for each.

        A sample of a channel takes about 400 bytes in the result. Long recordings can be given in
        pieces, one call after another: the numbers are the same.

        Args:
            time_s: stamps [s], shape (samples,) for all channels, or (channels, samples).
            displacements_mm: penetrations [mm], shape (channels, samples); NaN as in `step`.
            forces_n: contact forces [N], shape (channels, samples); NaN as in `step`.

        Returns:
            The estimates after each sample; the leading axis is that of the channels.

        Raises:
            ValueError: an array has another shape.
            TypeError: an array holds dates, durations or what is no number.
        """
        displacements = as_numbers("displacements_mm", displacements_mm)
        if displacements.ndim != 2 or displacements.shape[0] != self._channels:
            raise ValueError(
                f"displacements_mm has the shape {displacements.shape}: give (channels, samples), "
                f"{self._channels} and any number"
            )
        count = displacements.shape[1]
        samples = np.empty((self._channels, count, 3))
        whole = (self._channels, count)
        self._take(samples[..., 1], "displacements_mm", displacements, (whole,))
        self._take(samples[..., 0], "time_s", time_s, ((count,), whole))
        self._take(samples[..., 2], "forces_n", forces_n, (whole,))
        rows = np.empty((self._channels, count, COLUMNS))
        self._use(samples, rows)
        return EstimatesOfChannels(rows)

    def reset(self, channel: int | None = None) -> None:
        """Forget all samples, of all channels or of one; the parameters stay.

        Raises:
            ValueError: there is no such channel.
        """
        whole = isinstance(channel, (int, np.integer))
        if channel is not None and not (whole and 0 <= channel < self._channels):
            raise ValueError(f"channel = {channel!r} is not one from 0 to {self._channels - 1}")
        self._one.reset()
        chosen = slice(None) if channel is None else slice(channel, channel + 1)
        self._memories[chosen] = self._one._memory[0]
        self._particles[chosen] = 0.0
        for late in self._late[chosen]:
            late.forget()

    def reconfigure(self, **parameters: object) -> None:
        """Change parameters of all channels while running, all of them or, on an error, none.

        Raises:
            ValueError: a parameter is unknown, out of range or fixed while running; the message
                names it, its value and what is allowed.
        """
        self._one.reconfigure(**parameters)  # checks, and writes what all channels share
        for i in range(self._channels):
            self._one._take_into(self._memories[i : i + 1], parameters)
        for late in self._late:
            for memory in late.memories:
                self._one._take_into(memory, parameters)

    def warm_up(self) -> None:
        """Compile (or load from the cache) what the others need; the state stays."""
        self._one.warm_up()
        nothing = np.zeros((0, 0, 3))
        self._kernel(
            self._one._settings,
            self._memories[:0],
            self._particles[:0],
            nothing,
            np.zeros((0, 0, COLUMNS)),
        )

    def _take(
        self, target: Array, name: str, given: ArrayLike, shapes: tuple[tuple[int, ...], ...]
    ) -> None:
        """Copy what was given to a part of the samples.

        Raises:
            ValueError: it has none of the shapes.
        """
        values = as_numbers(name, given)
        if values.shape not in shapes:
            allowed = " or ".join(map(str, shapes))
            raise ValueError(f"{name} has the shape {values.shape}, not {allowed}")
        target[...] = values

    def _use(self, samples: Array, rows: Array) -> None:
        """Use samples, shape (channels, samples, 3), and fill their rows."""
        if self._late:
            for i in range(self._channels):
                self._use_late(i, samples[i], rows[i])
        elif self._pool is None:
            self._use_share(slice(None), samples, rows)
        else:
            futures = [
                self._pool.submit(self._use_share, share, samples, rows) for share in self._shares
            ]
            for future in futures:
                future.result()

    def _use_share(self, share: slice, samples: Array, rows: Array) -> None:
        memories, particles = self._memories[share], self._particles[share]
        self._kernel(self._one._settings, memories, particles, samples[share], rows[share])

    def _use_late(self, channel: int, samples: Array, rows: Array) -> None:
        memory, particles = self._memories[channel : channel + 1], self._particles[channel]
        run = FILTERS[self.filter].run

        def runner(some: Array, their_rows: Array) -> None:
            run(self._one._settings, memory, particles, some, their_rows)

        self._late[channel].run(
            runner, memory, particles, lambda: last_time(memory[0]), samples, rows
        )


def _whole(name: str, value: object, most: int) -> int:
    if isinstance(value, (int, np.integer)) and not isinstance(value, bool) and 1 <= value <= most:
        return int(value)
    raise ValueError(f"{name} = {value!r} is not a whole number from 1 to {most}")
