"""A haptic device with CRTK names, and a slave that sends one model. Prints JSON.

Usage: fake_device.py RATE PRESSES MASTER_PORT SLAVE_PORT. The device presses 3 mm deep from 2 mm
above the tissue, again and again, and falls silent at last. Depth is -z, in metres. Everything is
counted by the own samples and by stamps: on a busy machine both lag, and neither is left out.
"""

import json
import sys
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from hc_msgs.msg import HuntCrossleyEstimate
from rclpy.executors import SingleThreadedExecutor
from rclpy.serialization import deserialize_message

from hc_msgs_py.middleware import set_defaults
from hc_msgs_py.qos import DIAGNOSTICS_QOS, SAMPLE_QOS
from hc_msgs_py.topics import DIAGNOSTICS, MASTER_MEASURED_CP, MASTER_MODEL, MASTER_SERVO_CF
from hc_msgs_py.units import nanoseconds_from_stamp, set_stamp
from hc_sim_rig.bilateral.datagrams import SLAVE, Datagram
from hc_sim_rig.bilateral.udp_link import Added, Clocks, UdpLink
from hc_sim_rig.pacing import DeadlineThread

SPRING = (0.4, 0.0, 1.0, 1.0, 0.0)
OUT_MM, IN_MM = -2.0, 3.0
ABOVE_S, WAY_S, BELOW_S = 0.3, 0.25, 0.4


def depth_at(second: float) -> float:
    """Where the device is in its press."""
    in_way = (second - ABOVE_S) / WAY_S
    out_way = (second - ABOVE_S - WAY_S - BELOW_S) / WAY_S
    return OUT_MM + (IN_MM - OUT_MM) * min(max(min(in_way, 1.0 - out_way), 0.0), 1.0)


def main() -> None:
    rate, presses = float(sys.argv[1]), int(sys.argv[2])
    press_s = ABOVE_S + 2.0 * WAY_S + BELOW_S
    samples = round(presses * press_s * rate)
    set_defaults()
    rclpy.init()
    node = rclpy.create_node("device")
    # As drivers do it: reliable, and a queue.
    poses = node.create_publisher(PoseStamped, MASTER_MEASURED_CP, 10)
    forces: list[bytes] = []
    above: list[float] = []  # forces where the master saw the device above the tissue
    status: dict[str, str] = {}

    def on_model(message: HuntCrossleyEstimate) -> None:
        if message.displacement <= 0.0:
            above.append(abs(message.force_reconstructed))

    def on_status(message: DiagnosticArray) -> None:
        for one in message.status:
            if one.name == "master":
                status.update({value.key: value.value for value in one.values})
                status["message"] = one.message

    node.create_subscription(
        WrenchStamped,
        MASTER_SERVO_CF,
        lambda data: forces.append(bytes(data)),
        2000,
        raw=True,
    )
    node.create_subscription(HuntCrossleyEstimate, MASTER_MODEL, on_model, SAMPLE_QOS)
    node.create_subscription(DiagnosticArray, DIAGNOSTICS, on_status, DIAGNOSTICS_QOS)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + 60.0
    while not forces and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    clocks = Clocks(time.time_ns, time.monotonic_ns)
    here, there = int(sys.argv[4]), int(sys.argv[3])
    link = UdpLink(SLAVE, "127.0.0.1", here, "127.0.0.1", there, Added(), 1, clocks)
    message = PoseStamped()

    def act(index: int, stamp_ns: int) -> bool:
        now = time.time_ns()
        link.receive(now)
        depth = depth_at((index / rate) % press_s)
        link.send(Datagram(SLAVE, 0, 0, 0, 0, depth, 0.0, 0.0, 0.0, SPRING, sure=True), now)
        set_stamp(message.header.stamp, stamp_ns)
        message.pose.position.z = -1e-3 * depth
        poses.publish(message)
        return index + 1 < samples

    pace = DeadlineThread(rate, act, time.time_ns)
    forces.clear()
    pace.start()
    while pace.running:
        executor.spin_once(timeout_sec=0.05)
    felt = forces.copy()
    end = time.monotonic() + 60.0
    while "says nothing" not in status.get("message", "") and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    rows = [deserialize_message(data, WrenchStamped) for data in felt]
    stamps = np.array([nanoseconds_from_stamp(row.header.stamp) for row in rows])
    periods = np.diff(stamps) / 1e6
    last = deserialize_message(forces[-1], WrenchStamped)
    print(  # noqa: T201
        json.dumps(
            {
                "poses": samples,
                "forces": len(rows),
                "forces_wanted": round((stamps[-1] - stamps[0]) / 1e6) + 1,
                "off_the_grid_ms": float(np.abs(periods - np.round(periods)).max()),
                "force_above_n": max(above),
                "force_largest_n": max(row.wrench.force.z for row in rows),
                "force_after_silence_n": last.wrench.force.z,
                "master": status,
            }
        )
    )
    link.close()
    node.destroy_node()
    rclpy.try_shutdown()


main()
