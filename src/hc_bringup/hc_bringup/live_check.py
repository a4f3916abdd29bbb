"""A running estimator as `hc doctor` sees it: its topics, its own word, and its samples."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import sys
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_bringup import heartbeat
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.finding import Finding
from hc_bringup.graph import Graph
from hc_bringup.phrases import left_of
from hc_bringup.place_delay import delay_setting
from hc_bringup.reading_changes import change_lines
from hc_bringup.service_calls import AGAIN_S, Client
from hc_bringup.treated_samples import FORCE_LIMIT
from hc_bringup.turn_watch import TurnWatch
from hc_bringup.turning import turning_line
from hc_estimator.ros.node_settings import OWN_SENSORS
from hc_estimator.stream.merger import MAXIMUM_WAIT_S, TRANSPORT_S, needed_wait_s
from hc_estimator.stream.taken_off import TakenOff
from hc_estimator.stream.vocabulary import CHANNEL_DELAY, CONTACT_POSITION_STD
from hc_logger.events import ReadingChange, RecordedEvent, reading_changes
from hc_msgs_py.background import STARTING
from hc_msgs_py.conversion import Sample, sample_from_message
from hc_msgs_py.qos import CONFIGURATION_QOS, DIAGNOSTICS_QOS, SAMPLE_QOS
from hc_msgs_py.topics import DIAGNOSTICS, EVENTS, SAMPLE, SAMPLES
from hc_msgs_py.units import NANOSECONDS, nanoseconds_from_stamp
from hc_msgs_py.wire_arrays import SamplesDecoder

LEAST_SAMPLES = 100
NODE_SAYS = "the node says: "

Rows = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]


@dataclass
class Heard:
    """What was heard of a running estimator.

    Attributes:
        findings: what is wrong with its topics and its input.
        settings: its present input settings, by name below `input.`.
        surface_std_mm: how well the node says that it knows where displacements count from.
        force_limit_n: beyond which it refuses a force.
        channel_delay: by how much the force is late, as it was told [s], or "auto".
        rows: times [s], displacements [mm] and forces [N], zeros taken off; None without samples.
        notes: what else one should know of them, one line each.
    """

    findings: list[Finding] = field(default_factory=list)
    settings: dict[str, Any] = field(default_factory=dict)
    surface_std_mm: float = 0.0
    force_limit_n: float = math.inf
    channel_delay: float | str = "auto"
    rows: Rows | None = None
    notes: tuple[str, ...] = ()


def listen(node: str, seconds: float, request: str = "") -> Heard:
    """Listen to an estimator node and to the samples that it uses.

    Args:
        node: its name.
        seconds: how long.
        request: what a person is to do meanwhile; said as soon as it begins.

    Raises:
        UserError: if there is no such node, or if it is still starting.
        KeyboardInterrupt: if a signal asks to end.
    """
    from diagnostic_msgs.msg import DiagnosticArray
    from hc_msgs.msg import EstimatorEvent

    heard = Heard()
    events: list[RecordedEvent] = []
    samples: list[Sample] = []
    statuses: list[Any] = []
    with Graph() as graph:
        name = graph.require_node(node)
        _refuse_while_starting(graph, name)
        namespace = name.rpartition("/")[0]
        heard.settings = input_settings(graph, name)
        heard.surface_std_mm = settings_of(graph, name, CONTACT_POSITION_STD).get("", 0.0)
        heard.force_limit_n = settings_of(graph, name, FORCE_LIMIT).get("", math.inf)
        heard.channel_delay = delay_setting(settings_of(graph, name, CHANNEL_DELAY).get("", "auto"))
        turn = TurnWatch(graph, namespace, heard.settings)
        topic = SAMPLES if heard.settings.get("source") == "samples" else SAMPLE
        _subscribe_samples(graph, f"{namespace}/{topic}", samples)
        graph.node.create_subscription(
            DiagnosticArray,
            DIAGNOSTICS,
            lambda message: statuses.extend(
                s for s in message.status if s.name == name.lstrip("/")
            ),
            DIAGNOSTICS_QOS,
        )
        graph.node.create_subscription(
            EstimatorEvent,
            f"{namespace}/{EVENTS}",
            lambda e: events.append(
                RecordedEvent(nanoseconds_from_stamp(e.header.stamp), e.kind, e.reason)
            ),
            CONFIGURATION_QOS,
        )
        if request:
            print(request, file=sys.stderr, flush=True)
        begin = time.monotonic()
        while (left := begin + seconds - time.monotonic()) > 0.0:
            heartbeat.telling("listening", f"listening to {name}: {left:.0f} s left")
            if not graph.spin(min(left, 0.5)):
                raise KeyboardInterrupt
        changes = [c for c in reading_changes(events) if _is_within(c, samples)]
        if changes:
            heard.settings = input_settings(graph, name)
            heard.surface_std_mm = settings_of(graph, name, CONTACT_POSITION_STD).get("", 0.0)
        heartbeat.doing("judging what was heard")
    if not statuses:
        heard.findings.append(Finding(f"{name} tells no diagnostics: is it stopped or too busy?"))
    elif int.from_bytes(statuses[-1].level, "little") > 0:
        heard.findings.append(Finding(f"{NODE_SAYS}{statuses[-1].message}"))
    if line := turning_line(turn.degrees):
        heard.findings.append(Finding(line))
    if len(samples) < LEAST_SAMPLES:
        hidden = heard.settings.get("source") in OWN_SENSORS and not heard.settings.get(
            "publish_samples", True
        )
        heard.findings.append(
            Finding(
                f"{len(samples)} samples in {seconds:g} s on {topic}: nothing to judge"
                + (" (input.publish_samples is false)" if hidden else "")
            )
        )
        return heard
    rows = np.array(
        [(s.stamp_ns - samples[0].stamp_ns, s.displacement_mm, s.force_n) for s in samples]
    )
    rows[:, 0] *= 1e-9
    if changes:
        # The last part, for the settings are those of now.
        kept = np.array([s.stamp_ns for s in samples]) > changes[-1].stamp_ns
        rows = rows[kept]
        heard.notes = (
            *change_lines(changes, samples[0].stamp_ns),
            f"judged is what came after, {len(rows)} samples",
        )
    if heard.settings.get("source") not in OWN_SENSORS:  # those come with their zeros taken off
        taken_off = TakenOff()
        taken_off.configure({f"input.{name}": value for name, value in heard.settings.items()})
        stamps = np.round(rows[:, 0] * NANOSECONDS).astype(np.int64)
        rows[:, 1], rows[:, 2] = taken_off.of_many(stamps, rows[:, 1], rows[:, 2])
        rows = rows[~np.isnan(rows[:, 1:]).all(axis=1)]
    heard.rows = (rows[:, 0], rows[:, 1], rows[:, 2])
    return heard


def _subscribe_samples(graph: Graph, topic: str, samples: list[Sample]) -> None:
    """Put the samples of a topic into a list: of indenter/samples several to a message."""
    from hc_msgs.msg import IndenterSample, IndenterSamples

    if not topic.endswith(f"/{SAMPLES}"):
        graph.node.create_subscription(
            IndenterSample, topic, lambda m: samples.append(sample_from_message(m)), SAMPLE_QOS
        )
        return
    decoder = SamplesDecoder()

    def take(data: bytes) -> None:
        # What is no such message the node counts, and tells in its diagnostics.
        with contextlib.suppress(ValueError):
            samples.extend(map(Sample, *(column.tolist() for column in decoder.decode(data))))

    graph.node.create_subscription(IndenterSamples, topic, take, SAMPLE_QOS, raw=True)


def said_once(findings: list[Finding]) -> list[Finding]:
    """Return findings where the node's own words leave out what another finding says as well."""
    kept = []
    for finding in findings:
        if finding.what.startswith(NODE_SAYS):
            others = [f.what for f in findings if f is not finding]
            said = left_of(finding.what.removeprefix(NODE_SAYS), others)
            if not said:
                continue
            finding = dataclasses.replace(finding, what=NODE_SAYS + said)
        kept.append(finding)
    return kept


def _refuse_while_starting(graph: Graph, name: str) -> None:
    """See that a node does not compile: until that is done it takes no sample.

    Raises:
        UserError: if it does; says how far it is.
    """
    from std_srvs.srv import Trigger

    answer = Client(graph, Trigger, f"{name}/ready").call(Trigger.Request(), again_s=AGAIN_S)
    if not answer.success and answer.message.startswith(STARTING):
        raise UserError(f"{name} is {answer.message}: ask again when it is done", FAILURE)


def _is_within(change: ReadingChange, samples: list[Any]) -> bool:
    return bool(samples) and samples[0].stamp_ns <= change.stamp_ns < samples[-1].stamp_ns


def too_short_wait(rows: Rows, settings: dict[str, Any], findings: list[Finding]) -> list[Finding]:
    """Return a finding if readings wait for the other sensor for less than it is late.

    Args:
        rows: times, displacements and forces, as Heard has them.
        settings: the node's input settings, by name below `input.`.
        findings: what else is wrong, and may correct a time offset.
    """
    if settings.get("source") != "sensors":
        return []
    offsets = {
        name: settings.get(name, 0.0) + sum(f.settings.get(name, 0.0) for f in findings)
        for name in ("force.time_offset", "position.time_offset")
    }
    periods = [np.diff(rows[0][~np.isnan(values)]) for values in rows[1:]]
    if not all(len(steps) for steps in periods):
        return []
    delay_s = offsets["force.time_offset"] - offsets["position.time_offset"]
    wait_s = settings.get("pairing.maximum_wait", MAXIMUM_WAIT_S)
    needed_s = needed_wait_s(delay_s, max(float(np.quantile(steps, 0.1)) for steps in periods))
    if wait_s >= needed_s - TRANSPORT_S:
        return []
    return [
        Finding(
            f"readings wait {1e3 * wait_s:.0f} ms for those of the other sensor, and with the time "
            f"offsets ({1e3 * delay_s:+.0f} ms for the force) that is too short: those that come "
            "later are left out",
            {"pairing.maximum_wait": round(needed_s - wait_s, 3)},
        )
    ]


def input_settings(graph: Any, name: str) -> dict[str, Any]:
    """Return the input settings of an estimator node, by name below `input.`."""
    return settings_of(graph, name, "input.")


def settings_of(graph: Any, name: str, prefix: str) -> dict[str, Any]:
    """Return the settings of a node whose names begin so, by what follows."""
    from rclpy.parameter import parameter_value_to_python

    client = graph.parameter_client(name)
    names = graph.call(client.list_parameters, f"parameters of {name}").result.names
    wanted = [n for n in names if n.startswith(prefix)]
    values = graph.call(lambda: client.get_parameters(wanted), "values").values
    return {
        n.removeprefix(prefix): parameter_value_to_python(v)
        for n, v in zip(wanted, values, strict=True)
    }
