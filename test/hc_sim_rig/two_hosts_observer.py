"""Runs beside the slave of the two-host test: how late the master's motion arrives, what happens.

python two_hosts_observer.py SECONDS      # prints one line of JSON
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np
import rclpy
from hc_msgs.msg import IndenterTruth
from rclpy.experimental import EventsExecutor
from sensor_msgs.msg import JointState

from hc_msgs_py.qos import SAMPLE_QOS


def main() -> None:
    seconds = float(sys.argv[1])
    rclpy.init()
    node = rclpy.create_node("observer")
    latency: list[float] = []
    master: list[float] = []
    truth: list[tuple[float, float]] = []

    def on_joints(message: JointState) -> None:
        stamp = message.header.stamp
        latency.append(time.time() - stamp.sec - stamp.nanosec * 1e-9)
        master.append(message.position[0] * 1000.0)

    def on_truth(message: IndenterTruth) -> None:
        truth.append((message.displacement * 1000.0, message.force))

    node.create_subscription(JointState, "/master/indenter/joint_states", on_joints, SAMPLE_QOS)
    node.create_subscription(IndenterTruth, "/slave/indenter/truth", on_truth, SAMPLE_QOS)
    executor = EventsExecutor()
    executor.add_node(node)
    end = time.monotonic() + 40.0
    while not (latency and truth) and time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        executor.spin_once(timeout_sec=0.1)
    forces = np.array([force for _, force in truth[-1000:]])
    result = {
        "messages": len(latency),
        "latency_s": list(np.quantile(latency, [0.5, 0.99])) if latency else [],
        "master_mm": master[-1] if master else 0.0,
        "slave_mm": truth[-1][0] + 15.0 if truth else 0.0,
        "force_n": float(forces.mean()) if truth else 0.0,
        "force_swing_n": float(np.ptp(forces)) if truth else 0.0,
    }
    sys.stdout.write(json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
