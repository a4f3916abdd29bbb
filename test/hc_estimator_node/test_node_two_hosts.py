"""Rig on one host and estimator on another, with delay and loss between them."""

import json
from pathlib import Path

import numpy as np
import pytest

pytestmark = pytest.mark.process

DELAY_S = 0.1
LOSS = 0.01
SAMPLES = 1500

LISTENER = f"""
import json, time, rclpy
from hc_msgs.msg import HuntCrossleyEstimate
from hc_msgs_py.qos import ESTIMATE_QOS
rclpy.init()
node = rclpy.create_node("listener")
got = []
ages = []
def take(message):
    stamp = message.header.stamp
    ages.append(time.time() - stamp.sec - 1e-9 * stamp.nanosec)
    got.append(message)
node.create_subscription(HuntCrossleyEstimate, "hc/estimate", take, ESTIMATE_QOS)
print("up", flush=True)
end = time.monotonic() + 90
while time.monotonic() < end and (not got or got[-1].sequence < {SAMPLES - 1 - 50}):
    rclpy.spin_once(node, timeout_sec=0.1)
last = got[-1]
print(json.dumps(dict(ages=ages, latency=[m.latency for m in got],
    sequence=[m.sequence for m in got],
    parameters=[last.stiffness, last.damping, last.displacement_exponent,
        last.velocity_exponent],
    rejected=sum(m.rejected != 0 for m in got))))
"""

SOURCE = f"""
import sys, time, rclpy
sys.path.insert(0, {str(Path(__file__).parent)!r})
from conftest import Plant
from hc_msgs.msg import IndenterSample
from hc_msgs_py.conversion import fill_sample, new_sample_message
from hc_msgs_py.qos import SAMPLE_QOS
rclpy.init()
node = rclpy.create_node("source")
publisher = node.create_publisher(IndenterSample, "indenter/sample", SAMPLE_QOS)
while not publisher.get_subscription_count():
    time.sleep(0.05)
time.sleep(3.0)  # the reader learns of this writer up to 2.5 s later where an announcement is lost
message = new_sample_message()
begin, begin_ns = time.monotonic(), time.time_ns()
for i, (time_s, displacement, force) in enumerate(Plant(rate_hz=500.0).samples({SAMPLES})):
    while (left := begin + time_s - time.monotonic()) > 0:
        time.sleep(left)
    # stamped with the time that it was taken at, however late this process got to run
    fill_sample(message, begin_ns + round(1e9 * time_s), i, displacement, force)
    publisher.publish(message)
time.sleep(1.0)
"""


@pytest.fixture
def hosts(join_hosts, processes, compiled):
    """Run commands on two hosts that a slow link joins; all of it is gone afterwards."""
    link = join_hosts(DELAY_S, loss=LOSS)

    def start(command, host):
        through = ("ip", "netns", "exec", link.namespaces[host])
        subnet = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        return processes.start(*command, through=through, **subnet)

    yield start
    processes.close()  # before the hosts that they are on


@pytest.mark.slow
def test_estimates_go_on_across_a_slow_and_lossy_link_and_the_latency_is_true(hosts, plant):
    hosts(["-m", "hc_estimator.node"], host=1)
    listener = hosts(["-c", LISTENER], host=1)
    assert listener.stdout.readline() == "up\n"
    hosts(["-c", SOURCE], host=0)
    output, _errors = listener.communicate(timeout=110)
    found = json.loads(output)
    latency = np.array(found["latency"])
    assert latency.min() >= DELAY_S
    assert latency.min() < DELAY_S + 0.1
    assert (np.array(found["ages"]) >= latency - 1e-6).all()  # it had not arrived before it left
    sequence = found["sequence"]
    assert sequence == sorted(sequence)
    sent = sequence[-1] - sequence[0] + 1  # since the reader had learned of the writer
    assert sent > SAMPLES / 2
    assert 0.9 * sent < len(set(sequence)) < sent  # some were lost, and not many more
    np.testing.assert_allclose(found["parameters"], plant.parameters, rtol=0.15)
