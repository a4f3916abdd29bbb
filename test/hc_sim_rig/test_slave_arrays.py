"""The slave takes estimates that come in arrays, and those that come twice once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from hc_msgs.msg import HuntCrossleyEstimate, HuntCrossleyEstimates

from hc_msgs_py import qos
from hc_msgs_py.node_processes import Processes, ros_arguments
from hc_msgs_py.wire import publish_bytes
from hc_msgs_py.wire_arrays import ArraysEncoder

TOGETHER = 5


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.parametrize("both", [False, True])
def test_a_slave_takes_each_estimate_once(ros_domain: int, listener: Any, both: bool) -> None:
    parameters = {"start_paused": True, "find_surface": False, "link.port": 0}
    words = ros_arguments(parameters, "-r", "__node:=slave")
    with Processes(ros_domain) as processes:
        process = processes.start("-m", "hc_sim_rig.slave_node", *words)
        node = listener.node
        arrays = node.create_publisher(HuntCrossleyEstimates, "hc/estimates", qos.ESTIMATE_QOS)
        each = node.create_publisher(HuntCrossleyEstimate, "hc/estimate", qos.ESTIMATE_QOS)
        status: dict[str, float] = {}

        def on_status(message: DiagnosticArray) -> None:
            for one in message.status:
                values = {pair.key: pair.value for pair in one.values}
                if "estimates_undecodable" in values:
                    status.update(
                        (k, float(values[k])) for k in ("estimates", "estimates_undecodable")
                    )

        node.create_subscription(DiagnosticArray, "/diagnostics", on_status, qos.DIAGNOSTICS_QOS)
        assert listener.spin(
            until=lambda: arrays.get_subscription_count() == each.get_subscription_count() == 1
        )
        wanted = 100.0 * TOGETHER
        if both:  # one of each must have come before it can know that they come on both topics
            each.publish(HuntCrossleyEstimate())
            assert listener.spin(until=lambda: status.get("estimates") == 1.0)
            wanted += 1.0
        encoder = ArraysEncoder(HuntCrossleyEstimates)
        for i in range(100):
            if both:
                for k in range(TOGETHER):
                    each.publish(HuntCrossleyEstimate(sequence=TOGETHER * i + k))
            record = encoder.record(TOGETHER, 1_700_000_000_000_000_000 + i)
            record["sequence"] = TOGETHER * i + np.arange(TOGETHER)
            publish_bytes(arrays, (record.tobytes(),))
        publish_bytes(arrays, (b"\0\1\0\0 nothing",))
        assert listener.spin(until=lambda: status.get("estimates") == wanted), status
        listener.spin(1.5)
        assert status["estimates"] == wanted
        if not both:  # what comes on both topics is not even read here
            assert status["estimates_undecodable"] == 1.0
        process.terminate()
        assert process.wait(timeout=30.0) == 0
