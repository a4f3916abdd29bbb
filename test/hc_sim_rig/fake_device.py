"""A haptic device with CRTK names at 1 kHz, and a slave that sends one model. Prints JSON.

Usage: fake_device.py SECONDS MASTER_PORT SLAVE_PORT. The device hovers 2 mm above the tissue, goes
3 mm into it, and falls silent at last. Depth is -z, in metres.
"""

import json
import sys
import threading
import time

import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.executors import SingleThreadedExecutor

from hc_msgs_py.middleware import set_defaults
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import MASTER_MEASURED_CP, MASTER_SERVO_CF
from hc_msgs_py.units import set_stamp
from hc_sim_rig.bilateral.datagrams import SLAVE, Datagram
from hc_sim_rig.bilateral.udp_link import Added, UdpLink
from hc_sim_rig.pacing import DeadlineThread

SPRING = (0.4, 0.0, 1.0, 1.0, 0.0)
OUT_MM, IN_MM = -2.0, 3.0


def main() -> None:
    seconds, master_port, slave_port = float(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3])
    set_defaults()
    rclpy.init()
    node = rclpy.create_node("device")
    poses = node.create_publisher(PoseStamped, MASTER_MEASURED_CP, SAMPLE_QOS)
    forces: list[tuple[float, float]] = []
    node.create_subscription(
        WrenchStamped,
        MASTER_SERVO_CF,
        lambda message: forces.append((time.monotonic(), message.wrench.force.z)),
        SAMPLE_QOS,
    )
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    end = time.monotonic() + 60.0
    while not forces and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.05)
    link = UdpLink(SLAVE, "127.0.0.1", slave_port, "127.0.0.1", master_port, Added(), 1)
    message = PoseStamped()
    begin = time.monotonic()
    stop = threading.Event()

    def act(index: int, stamp_ns: int) -> bool:
        now = time.time_ns()
        link.receive(now)
        depth = OUT_MM
        if index > 1000 * seconds / 3:
            way = min((index / 1000.0 - seconds / 3) / 1.0, 1.0)
            depth += (IN_MM - OUT_MM) * way
        link.send(Datagram(SLAVE, 0, 0, 0, 0, depth, 0.0, 0.0, 0.0, SPRING, sure=True), now)
        set_stamp(message.header.stamp, stamp_ns)
        message.pose.position.z = -1e-3 * depth
        poses.publish(message)
        return index < 1000 * seconds and not stop.is_set()

    pace = DeadlineThread(1000.0, act, time.time_ns)
    pace.start()
    while pace.running:
        executor.spin_once(timeout_sec=0.05)
    silent = time.monotonic()
    while time.monotonic() < silent + 1.0:
        executor.spin_once(timeout_sec=0.05)
    third = begin + seconds / 3
    pressed = [force for at, force in forces if silent - 0.5 < at < silent - 0.1]
    print(  # noqa: T201
        json.dumps(
            {
                "poses": pace.report.acts,
                "forces": sum(begin < at < silent for at, _ in forces),
                "force_before_n": max(abs(force) for at, force in forces if at < third),
                # A stall of the machine is a silent device for a moment: those forces are zero.
                "force_pressed_n": sorted(pressed)[len(pressed) // 2] if pressed else 0.0,
                "force_after_silence_n": forces[-1][1],
            }
        )
    )
    link.close()
    node.destroy_node()
    rclpy.try_shutdown()


main()
