"""Node `array_estimator`: samples of a tactile array in, the estimates of all taxels out.

Thin: the stream is judged in stream/array_stream, the numbers are EstimatorArray's. Not a managed
node and without a state on disk: what it knows it learns anew with every touch.
"""

from __future__ import annotations

import sys
import time
from typing import Any, Final

from hc_msgs.msg import TactileEstimate, TactileSample
from rclpy.clock import Clock, ClockType
from rclpy.node import Node

from hc_estimator import EstimatorArray, parameter_specifications
from hc_estimator.array import ARRAY_FILTERS
from hc_estimator.kinds import (
    DEFAULT_CONTACT_MODEL,
    DEFAULT_STATE_SPACE,
    available_contact_models,
    available_state_spaces,
)
from hc_estimator.ros.channel import Channel, SubscriptionError, is_replayed
from hc_estimator.ros.compilation import Compilation
from hc_estimator.ros.inputs import publisher_conflict, why_unmatched
from hc_estimator.ros.services import add_service
from hc_estimator.specification import checked_values
from hc_estimator.stream.array_status import ArrayHealth, Effort, why_no_places
from hc_estimator.stream.array_stream import ArrayStream
from hc_estimator.stream.array_watch import ArrayWatch
from hc_estimator.stream.readings import MEANINGS
from hc_estimator.stream.vocabulary import SessionSettings
from hc_msgs_py.background import STARTING
from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.histogram import DurationHistogram
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.parameters import declare, refuse_unknown
from hc_msgs_py.qos import ESTIMATE_QOS
from hc_msgs_py.services import add_ready_service
from hc_msgs_py.topics import NODE_ARRAY_ESTIMATOR, TACTILE_ESTIMATE, TACTILE_SAMPLE
from hc_msgs_py.units import METRE_IN_MM
from hc_msgs_py.wire_arrays import ArraysDecoder, ArraysEncoder, fill_estimate_arrays

DEFAULT_FILTER: Final = "ukf"
"""A plain one: hundreds of taxels at 1 kHz leave no time for more on one core."""
_PLAINER: Final = {DEFAULT_FILTER: "ekf", "ekf": ""}
"""Filters that take less time; where nothing stands here it is the usual one."""
BEGIN_PERIOD_S: Final = 0.1
"""Between two looks whether the filter is compiled."""
_COLUMNS: Final = ("force_reconstructed", "contact", "rejected")


class ArrayEstimatorNode(Node):  # type: ignore[misc]  # rclpy has no types
    """Estimates the contact parameters under every taxel."""

    def __init__(self) -> None:
        """Declare parameters and begin to compile; `_begin` listens when that is done.

        Raises:
            NodeStartError: for a parameter that cannot be.
            ValueError: for a value that is not allowed.
        """
        super().__init__(NODE_ARRAY_ESTIMATOR)
        self._kind = {
            name: declare(self, name, default, about, choices=choices, read_only=True)
            for name, default, about, choices in (
                ("filter", DEFAULT_FILTER, "filter of every taxel", ARRAY_FILTERS),
                ("state_space", DEFAULT_STATE_SPACE, "its states", available_state_spaces()),
                ("contact_model", DEFAULT_CONTACT_MODEL, "its law", available_contact_models()),
            )
        }
        self._kind["threads"] = declare(
            self,
            "threads",
            1,
            "processors that share the taxels",
            minimum=1,
            maximum=1024,
            read_only=True,
        )
        given = declare(
            self,
            "settings",
            [""],
            "parameters of the filter, each as NAME=VALUE",
            read_only=True,
        )
        self._values = _parsed([text for text in given if text])
        self._maximum_backlog = declare(
            self,
            "input.maximum_backlog",
            100,
            "samples that may wait; more are left out, the oldest first",
            minimum=1,
            maximum=2000,
            read_only=True,
        )
        self._expected = declare(
            self,
            "expected_sample_publishers",
            1,
            f"publishers of {TACTILE_SAMPLE} that ~/ready waits for",
            minimum=0,
            maximum=1000,
        )
        refuse_unknown(self)
        self._check_kind()
        self._failure: Exception | None = None
        self._skipped = self._undecodable = 0
        self._health, self._watch = ArrayHealth(), ArrayWatch()
        self._columns, self._pitch_m = 0, 0.0  # of the newest sample
        self._replayed = True  # until the first status looks who publishes
        self._afresh = ""  # why, the last time
        self._computation, self._latency = DurationHistogram(), DurationHistogram()
        gap_s = SessionSettings.maximum_gap_s
        self._stream = ArrayStream(self._make, maximum_gap_s=gap_s)
        self._decoder = ArraysDecoder(TactileSample)
        self._encoder = ArraysEncoder(TactileEstimate, "")
        self._frame_id = ""
        self._publisher = self.create_publisher(TactileEstimate, TACTILE_ESTIMATE, ESTIMATE_QOS)
        self._channel: Channel | None = None
        add_ready_service(self, self._missing)
        add_service(self, "reset", self._reset)
        self._diagnostics = DiagnosticsPublisher(self, "array_estimator", self._collect)
        self._compilation = Compilation(
            self.get_logger(), "the filter", [lambda: self._make(1).warm_up()]
        )
        # The machine's own steady clock: simulated time may stand still.
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._beginning = self.create_timer(BEGIN_PERIOD_S, self._begin, clock=steady)

    def _check_kind(self) -> None:
        """See that there is such a filter with such settings, without compiling it.

        Raises:
            ValueError: if not.
        """
        kind = self._kind
        specifications = parameter_specifications(
            kind["filter"], kind["state_space"], kind["contact_model"], internal=self._values
        )
        checked_values(specifications, self._values)

    def _begin(self) -> None:
        """Listen as soon as the filter is compiled."""
        if not self._compilation.look():
            return
        self._compilation.wait()  # raises what ended it
        self._beginning.cancel()
        try:
            self._channel = Channel(
                self,
                TactileSample,
                TACTILE_SAMPLE,
                self._take,
                skip=self._skip,
                fail=self._fail,
                raw=True,
            )
        except SubscriptionError as error:
            raise NodeStartError(str(error)) from error
        self._channel.maximum_backlog = self._maximum_backlog

    def _make(self, taxels: int) -> EstimatorArray:
        kind = self._kind
        return EstimatorArray(
            kind["filter"],
            taxels,
            state_space=kind["state_space"],
            contact_model=kind["contact_model"],
            threads=kind["threads"],
            **self._values,
        )

    def _take(self, data: bytes) -> None:
        try:
            stamp_ns, record = self._decoder.decode(data)
        except ValueError:
            self._undecodable += 1
            return
        if self._decoder.frame_id != self._frame_id:
            self._frame_id = self._decoder.frame_id
            self._encoder.set_frame(self._frame_id)
        sequence = int(record["sequence"])
        self._columns, self._pitch_m = int(record["columns"]), float(record["pitch"])
        displacements_mm = record["displacement"] * METRE_IN_MM
        before = time.perf_counter_ns()
        series = self._stream.take(stamp_ns, sequence, displacements_mm, record["force"])
        spent_ns = time.perf_counter_ns() - before
        if self._stream.fresh is not None:
            self._afresh, self._stream.fresh = self._stream.fresh.reason, None
            self._watch.forget(len(displacements_mm))
            # Two arrays on one topic start it afresh with every sample.
            self.get_logger().warning(f"started afresh: {self._afresh}", throttle_duration_sec=5.0)
        if series is None:
            return
        out = self._encoder.record(len(series), stamp_ns)
        for name in ("sequence", "columns", "pitch"):
            out[name] = record[name]
        out["force_measured"] = record["force"]
        fill_estimate_arrays(out, series, _COLUMNS)
        latency_ns = self.get_clock().now().nanoseconds - stamp_ns
        out["computation_time"] = spent_ns * 1e-9
        out["latency"] = latency_ns * 1e-9
        self._publisher.publish(out.tobytes())
        self._health.add(series.rejected)
        self._computation.add(spent_ns)
        self._latency.add(latency_ns)
        self._watch.add(stamp_ns, displacements_mm, record["force"])
        self._watch.add_latency(latency_ns, live=not self._replayed)
        if self._watch.looking and self._channel is not None and not self._channel.waits:
            self._watch.go_on()

    def _skip(self, number: int) -> None:
        self._skipped += number
        self._stream.expect_gap(number)

    def _fail(self, error: Exception) -> None:
        self._failure = error

    def _reset(self) -> str:
        self._stream.reset()
        return "started afresh"

    def _missing(self) -> list[str]:
        if self._channel is None:
            return [f"{STARTING}{self._compilation.progress}"]
        found, expected = self._channel.publishers, self._expected
        if found < expected:
            return [f"{TACTILE_SAMPLE} has {found} of {expected} publishers"]
        return []

    def _collect(self) -> Status:
        if self._channel is None:
            return Status(Level.OK, f"{STARTING}{self._compilation.progress}", {})
        stream = self._stream
        problems = self._problems(self._channel)
        values: dict[str, Any] = {
            "filter": self._kind["filter"],
            "taxels": stream.taxels,
            "samples": stream.received,
            "estimates": stream.used,
            "lost": stream.lost,
            "late": stream.late,
            "strays": stream.strays,
            "skipped": self._skipped,
            "undecodable": self._undecodable,
            "restarts": stream.restarts,
            "taxels_without_reading": self._health.without_reading,
        }
        self._health.begin_anew()
        for name, histogram in (("latency", self._latency), ("computation", self._computation)):
            if histogram.count:
                for label, fraction in (("p50", 0.5), ("p99", 0.99)):
                    values[f"{name}_{label}_us"] = histogram.quantile_ns(fraction) / 1000.0
                values[f"{name}_max_us"] = histogram.maximum_ns / 1000.0
            histogram.clear()
        if problems:
            return Status(Level.WARN, "; ".join(problems), values)
        return Status(
            Level.OK, "estimating" if stream.used else "waits for the first sample", values
        )

    def _problems(self, channel: Channel) -> list[str]:
        """Say what is wrong with the stream since the last status, and with who publishes it."""
        stream, came_ns = self._stream, channel.received_ns
        self._replayed = is_replayed([channel])
        counts = {
            "received": stream.received,
            "late": stream.late,
            "strays": stream.strays,
            "restarts": stream.restarts,
            "undecodable": self._undecodable,
            "skipped": self._skipped,
        }
        silent_s = (time.time_ns() - came_ns) * 1e-9 if came_ns else None
        effort = None
        if self._computation.count:
            kind, median_s = self._kind["filter"], self._computation.quantile_s(0.5)
            effort = Effort(stream.taxels, kind, median_s, _PLAINER.get(kind, DEFAULT_FILTER))
        found = self._health.problems(counts, silent_s=silent_s, afresh=self._afresh, effort=effort)
        if stream.used and (
            placeless := why_no_places(stream.taxels, self._columns, self._pitch_m)
        ):
            found.append(placeless)
        for new in self._watch.look(time.monotonic(), self._columns):
            self.get_logger().warning(f"{new} ({MEANINGS} explains it)")
        found += self._watch.problems
        if failure := self._watch.failure:
            found.append(f"a look at the readings came to nothing: {failure}")
        about_publishers = publisher_conflict([channel]) or why_unmatched(channel)
        return [about_publishers, *found] if about_publishers else found

    def finished(self) -> bool:
        """Whether the node wants to end by itself: never.

        Raises:
            Exception: what went wrong where the executor could not tell.
        """
        if self._failure is not None:
            raise self._failure
        return False

    def close(self) -> None:
        """Say a last status and stop listening."""
        self._diagnostics.publish()
        if self._channel is not None:
            self._channel.close()


def _parsed(given: list[str]) -> dict[str, object]:
    """Return the filter's parameters from NAME=VALUE.

    Raises:
        NodeStartError: if one has another form.
    """
    values: dict[str, object] = {}
    for text in given:
        name, equals, value = text.partition("=")
        if not (name and equals):
            raise NodeStartError(f"parameter settings has {text!r}: give NAME=VALUE")
        values[name.strip()] = _value(value.strip())
    return values


def _value(text: str) -> object:
    """Return a number, true or false, or the word itself."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text


def main() -> int:
    """Run the node; returns the exit status."""
    return run_node(ArrayEstimatorNode)


if __name__ == "__main__":
    sys.exit(main())
