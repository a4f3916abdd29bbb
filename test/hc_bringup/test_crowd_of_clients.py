"""A service that many ask at once: the answers to the others do not push out ours."""

import sys
import time

import pytest
from std_srvs.srv import Trigger

from hc_bringup.graph import Graph
from hc_bringup.service_calls import Client
from hc_msgs_py.qos import SERVICE_QOS

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]

CROWD = 30

SERVER = """
import rclpy
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

rclpy.init()
node = rclpy.create_node("asked")
node.create_service(
    Trigger, "~/ask", lambda _, answer: answer, qos_profile=QoSProfile(depth=1000)
)
rclpy.spin(node)
"""


def test_of_a_crowd_that_asks_everybody_gets_the_answer(command_line, tmp_path, monkeypatch):
    """Regression: a queue of 10 answers lost it, for it gets those to all clients."""
    path = tmp_path / "asked_node.py"
    path.write_text(SERVER)
    command_line.launch([sys.executable, str(path)])
    for name, value in command_line.environment.items():
        monkeypatch.setenv(name, value)
    with Graph() as graph:
        others = [
            graph.node.create_client(Trigger, "/asked/ask", qos_profile=SERVICE_QOS)
            for _ in range(CROWD)
        ]
        ours = Client(graph, Trigger, "/asked/ask")
        futures = [ours._client.call_async(Trigger.Request())]
        futures += [other.call_async(Trigger.Request()) for other in others]
        time.sleep(1.5)  # all answers have come before one is taken
        assert graph.wait_for(lambda: all(future.done() for future in futures))
