"""hc payload: mass, centre and offset of what hangs on a force sensor, from attitudes at rest."""

from __future__ import annotations

import argparse
import sys
import time
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import positive

HELP = "identify what hangs on the force sensor, and tell the estimator"
HEARTBEAT = True
REST_S = 2.0
ONE_GO_S = 30.0
ATTITUDES = 6


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from hc_bringup.service_calls import add_node_option

    add_node_option(parser)
    parser.add_argument("--force", metavar="TOPIC", help="wrench topic (default: the estimator's)")
    parser.add_argument("--pose", metavar="TOPIC", help="pose topic (default: the estimator's)")
    parser.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help=f"with --yes: record so long, while the robot goes through its attitudes "
        f"(default: {ONE_GO_S:g})",
    )
    parser.add_argument("--yes", action="store_true", help="ask nothing, record at once")
    parser.add_argument("--dry-run", action="store_true", help="only print what was found")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    import numpy as np

    from hc_bringup.graph import Graph
    from hc_bringup.live_check import input_settings
    from hc_estimator.stream.contact_frame import product, unit_quaternion
    from hc_estimator.stream.payload import GRAVITY, identify_payload, still_readings

    if arguments.seconds is not None and not arguments.yes:
        raise UserError("--seconds is for --yes: without it each rest has its own time", WRONG_USE)
    if not (arguments.yes or sys.stdin.isatty()):
        raise UserError("there is no terminal to ask at: give --yes", WRONG_USE)
    with Graph() as graph:
        node = None
        settings: dict[str, Any] = {}
        if not (arguments.dry_run and arguments.force and arguments.pose):
            node = graph.require_node(arguments.node)
            settings = input_settings(graph, node)
        if settings.get("force.in_base"):
            raise UserError(
                "input.force.in_base is true: a driver that tells the wrench in the base frame "
                "takes the payload off itself",
                FAILURE,
            )
        wrenches, poses = _record(graph, arguments, settings)
        heartbeat.doing("identifying the payload")
        mounting = unit_quaternion(settings.get("force.mounting", (0.0, 0.0, 0.0, 1.0)))
        attitudes = np.array([product(q[1:], mounting) for q in poses])
        times = np.array([q[0] for q in poses])
        rows = np.array(wrenches)
        try:
            still = still_readings(rows[:, 0], rows[:, 1:], times, attitudes)
        except ValueError as error:
            raise UserError(f"{error} ({arguments.pose or settings['position.topic']})") from error
        x, y, z = map(float, settings.get("gravity", GRAVITY))
        gravity = (x, y, z)
        try:
            found = identify_payload(*still, gravity)
        except ValueError as error:
            raise UserError(f"{error}: rest in each attitude for a second or more") from error
        heartbeat.nothing()
        _tell(found)
        if not found.is_explained:
            why = _why_not(found, still, gravity, mounting, node or f"/{arguments.node}")
            raise UserError(f"{why}; nothing was set")
        if node is not None and not arguments.dry_run:
            _set(graph, node, found)
    return 0


def _record(
    graph: Any, arguments: argparse.Namespace, settings: dict[str, Any]
) -> tuple[list[Any], list[Any]]:
    """Record wrenches (time, force, torque) and attitudes (time, quaternion)."""
    from geometry_msgs.msg import WrenchStamped

    from hc_bringup.asking import Asker
    from hc_bringup.graph import absolute
    from hc_bringup.robot_streams import POSITIONS
    from hc_msgs_py.interface_class import interface_class
    from hc_msgs_py.qos import SAMPLE_QOS
    from hc_msgs_py.units import nanoseconds_from_stamp

    kind = settings.get("position.type", "pose") if arguments.pose is None else "pose"
    if kind in ("joint", "tf"):
        raise UserError(f"input.position.type is {kind}: a payload needs poses (--pose TOPIC)")
    type_name = next(name for name, short in POSITIONS.items() if short == kind)
    force = absolute(arguments.force or settings["force.topic"])
    pose = absolute(arguments.pose or settings["position.topic"])
    wrenches: list[Any] = []
    poses: list[Any] = []
    origin: list[int] = []

    def time_of(message: Any) -> float:
        stamp = nanoseconds_from_stamp(message.header.stamp)
        origin.append(stamp) if not origin else None
        return (stamp - origin[0]) * 1e-9

    def take_wrench(message: Any) -> None:
        f, t = message.wrench.force, message.wrench.torque
        wrenches.append((time_of(message), f.x, f.y, f.z, t.x, t.y, t.z))

    def take_pose(message: Any) -> None:
        q = message.pose.orientation if kind == "pose" else message.transform.rotation
        poses.append((time_of(message), q.x, q.y, q.z, q.w))

    node = graph.node
    node.create_subscription(WrenchStamped, force, take_wrench, SAMPLE_QOS)
    node.create_subscription(interface_class(type_name), pose, take_pose, SAMPLE_QOS)
    graph.wait_for(lambda: bool(wrenches and poses))
    if arguments.yes:
        print("recording; go from attitude to attitude and rest a second in each", flush=True)
        _record_for(graph, arguments.seconds or ONE_GO_S)
    else:
        print(f"Free of contact, turn the tool into {ATTITUDES} attitudes, as different as it can.")
        asker = Asker()
        for i in range(ATTITUDES):
            heartbeat.nothing()
            asker.ask(f"attitude {i + 1} of {ATTITUDES}: let it rest, then press Enter.")
            _record_for(graph, REST_S)
    for rows, topic in ((wrenches, force), (poses, pose)):
        if not rows:
            raise UserError(f"no message on {topic}", FAILURE)
    return wrenches, poses


def _record_for(graph: Any, seconds: float) -> None:
    """Record for a while.

    Raises:
        KeyboardInterrupt: if a signal asks to end: half of the attitudes are no payload.
    """
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0.0:
        heartbeat.telling("recording", f"recording: {left:.0f} s left")
        if not graph.spin(min(left, 0.25)):
            raise KeyboardInterrupt


def _tell(found: Any) -> None:
    def vector(values: Any, deviations: Any, unit: str) -> str:
        numbers = ", ".join(f"{v:.4g}" for v in values)
        worst = max(deviations)
        return f"({numbers}) {unit}" + ("" if worst != worst else f", ± {worst:.2g} {unit}")

    print(
        f"{found.attitudes} attitudes, residual {found.residual_n:.3g} N\n"
        f"mass   {found.mass:.4g} ± {found.mass_std:.2g} kg\n"
        f"center {vector(found.center, found.center_std, 'm')} in the sensor's frame\n"
        f"offset {vector(found.force_bias, found.force_bias_std, 'N')}"
    )


def _why_not(found: Any, still: Any, gravity: Any, mounting: Any, node: str) -> str:
    """Return why the forces are no weight's, and what to type where another setting makes them one.

    Args:
        found: the payload that was identified.
        still: readings at rest.
        gravity: in the frame of the pose, as it was set.
        mounting: of the sensor, as it was set.
        node: the estimator's.
    """
    from hc_estimator.stream.contact_frame import product
    from hc_estimator.stream.payload import is_small
    from hc_estimator.stream.payload_frames import explain_otherwise

    said = f"a weight explains these forces to {found.residual_n:.2g} N only"
    other = explain_otherwise(still.forces, still.attitudes, gravity)
    if other is None or not is_small(other.residual_n, other.mass, gravity):
        return (
            f"{said}: is the sensor turned against the pose (input.force.mounting), is down "
            "another way in the frame of the pose (input.gravity), or did the tool touch "
            "something?"
        )
    if other.name == "gravity":
        value, what = other.value, "the frame of the pose does not stand upright"
    else:
        value, what = product(mounting, other.value), "the sensor is turned against the pose"
    numbers = ", ".join(f"{v:.4f}" for v in value)
    return (
        f"{said}, and to {other.residual_n:.2g} N ({other.mass:.3g} kg) if {what}: if that can be, "
        f"hc param set {node.strip('/')} input.{other.name} '[{numbers}]', and hc payload again"
    )


def _set(graph: Any, node: str, found: Any) -> None:
    from rclpy.parameter import Parameter

    client = graph.parameter_client(node)
    values = [
        Parameter("input.payload.mass", value=round(found.mass, 5)),
        Parameter("input.payload.force_bias", value=[round(float(b), 4) for b in found.force_bias]),
    ]
    answer = graph.call(lambda: client.set_parameters_atomically(values), "setting the payload")
    if not answer.result.successful:
        raise UserError(answer.result.reason, FAILURE)
    print(f"set in {node}; hc param dump {node.strip('/')} keeps it")
