"""Listens to a live master for a while: largest force, last model, last status. Prints JSON.

Usage: live_observer.py SECONDS, counted from the first force.
"""

import json
import sys
import time

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import HuntCrossleyEstimate
from rclpy.executors import SingleThreadedExecutor

from hc_msgs_py.middleware import set_defaults
from hc_msgs_py.qos import DIAGNOSTICS_QOS, SAMPLE_QOS
from hc_msgs_py.topics import DIAGNOSTICS, MASTER_MODEL, MASTER_SERVO_CF


def main() -> None:
    set_defaults()
    rclpy.init()
    node = rclpy.create_node("observer")
    found = {"force_n": 0.0, "stiffness": 0.0, "forces": 0, "status": {}}

    def on_force(message: WrenchStamped) -> None:
        found["forces"] += 1
        found["force_n"] = max(found["force_n"], message.wrench.force.z)

    def on_model(message: HuntCrossleyEstimate) -> None:
        if message.stiffness == message.stiffness:
            found["stiffness"] = message.stiffness

    def on_status(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "master":
                values = {one.key: one.value for one in status.values}
                if float(values["link_received"]) > 0:
                    found["status"] = values

    node.create_subscription(WrenchStamped, MASTER_SERVO_CF, on_force, SAMPLE_QOS)
    node.create_subscription(HuntCrossleyEstimate, MASTER_MODEL, on_model, SAMPLE_QOS)
    node.create_subscription(DiagnosticArray, DIAGNOSTICS, on_status, DIAGNOSTICS_QOS)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    patience = time.monotonic() + 90.0
    while not found["forces"] and time.monotonic() < patience:
        executor.spin_once(timeout_sec=0.1)
    end = time.monotonic() + float(sys.argv[1])
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    print(json.dumps(found))  # noqa: T201
    node.destroy_node()
    rclpy.try_shutdown()


main()
