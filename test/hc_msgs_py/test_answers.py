"""Whoever asks a node much and is gone does not keep it from its samples."""

import sys
import time
import warnings
from types import SimpleNamespace

import pytest

from hc_msgs_py import answers
from hc_msgs_py.answers import client_of, give_up_on_clients_that_are_gone
from hc_msgs_py.node_processes import wait

NODE = """
import sys, time
from rclpy.node import Node
from std_srvs.srv import Trigger
from hc_msgs_py.node_main import run_node
from hc_msgs_py.qos import SERVICE_QOS

class Asked(Node):
    def __init__(self):
        super().__init__("asked")
        self.asked = 0
        self.create_service(Trigger, "~/do", self.do, qos_profile=SERVICE_QOS)
        print("up", flush=True)
    def do(self, request, response):
        if not self.asked:
            time.sleep(2.0)  # until the client is gone
        self.asked += 1
        response.success, response.message = True, str(self.asked)
        return response
    def finished(self):
        return False
    def close(self):
        print(self.asked, flush=True)

sys.exit(run_node(Asked))
"""

ASKING = """
import sys, time, rclpy
from std_srvs.srv import Trigger
from hc_msgs_py.qos import SERVICE_QOS
rclpy.init()
node = rclpy.create_node("asking")
client = node.create_client(Trigger, "/asked/do", qos_profile=SERVICE_QOS)
assert client.wait_for_service(30.0)
futures = [client.call_async(Trigger.Request()) for _ in range(int(sys.argv[1]))]
if sys.argv[1] != "1":  # gone before the first is answered
    time.sleep(0.3)
else:
    begun = time.monotonic()
    rclpy.spin_until_future_complete(node, futures[0], timeout_sec=30.0)
    print(f"{time.monotonic() - begun:.2f} {futures[0].result().message}", flush=True)
node.destroy_node()
rclpy.shutdown()
"""


@pytest.mark.process
def test_what_a_client_asked_that_is_gone_holds_nobody_up(ros_domain, processes):
    """Regression: each answer waited for 0.1 s, and whoever asked next for all of them."""
    node = processes.start("-c", NODE)
    assert node.stdout.readline() == "up\n"
    gone = processes.start("-c", ASKING, "120")
    assert wait(gone, 30.0)[0] == 0
    status, output, errors = wait(processes.start("-c", ASKING, "1"), 60.0)
    assert status == 0, errors
    waited_s, number = output.split()
    assert float(waited_s) < 5.0  # of 12
    assert int(number) == 121  # what was asked was done
    node.terminate()
    status, output, errors = wait(node, 30.0)
    assert (status, output) == (0, "121\n")
    assert errors.count("a client of ~/do is gone") == 1
    assert "RuntimeWarning" not in errors


@pytest.fixture
def service(monkeypatch):
    """A service whose clients are gone or not, with what it sent and told."""
    sent, told, gone = [], [], set()

    def send(response, header):
        sent.append(response)
        if header.client in gone:
            warnings.warn("failed to send response (timeout): client ...", RuntimeWarning, 2)

    one = SimpleNamespace(send_response=send, srv_name="/node/do")
    logger = SimpleNamespace(warning=told.append)
    monkeypatch.setattr(answers, "client_of", lambda header: header.client)
    give_up_on_clients_that_are_gone(SimpleNamespace(services=[one], get_logger=lambda: logger))

    def ask(client, number, received_ns=None):
        received_ns = time.time_ns() if received_ns is None else received_ns
        header = SimpleNamespace(client=client, received_timestamp=received_ns)
        one.send_response(number, header)

    return SimpleNamespace(ask=ask, sent=sent, told=told, gone=gone)


def test_only_what_the_one_asked_before_is_given_up(service):
    service.gone.add(b"a")
    before_ns = time.time_ns()
    for number in range(10):
        service.ask(b"a", number, before_ns)
        service.ask(b"b", "of b", before_ns)
    assert [answer for answer in service.sent if answer != "of b"] == [0]
    assert service.sent.count("of b") == 10
    assert len(service.told) == 1
    service.gone.clear()  # it was new, and is seen now
    service.ask(b"a", "new")
    assert service.sent[-1] == "new"


def test_a_client_that_asked_once_is_not_spoken_of(service):
    service.gone.add(b"a")
    service.ask(b"a", "answer")
    assert service.sent == ["answer"]
    assert not service.told


def test_a_clock_that_is_set_back_ends_it_after_a_minute(service, monkeypatch):
    service.gone.add(b"a")
    service.ask(b"a", "first")
    an_hour_ago_ns = time.time_ns() - 3600 * 10**9
    service.ask(b"a", "too early", an_hour_ago_ns)
    assert "too early" not in service.sent
    later_s = time.monotonic() + answers.LONGEST_S
    monkeypatch.setattr(answers.time, "monotonic", lambda: later_s)
    service.ask(b"a", "later", an_hour_ago_ns)
    assert service.sent[-1] == "later"


def test_where_nobody_knows_who_asked_all_is_answered(service):
    service.gone.add(b"")
    before_ns = time.time_ns()
    for number in range(10):
        service.ask(b"", number, before_ns)
    assert len(service.sent) == 10


def test_few_clients_are_remembered(service):
    before_ns = time.time_ns()
    names = [bytes([k // 256, k % 256]) for k in range(300)]
    service.gone.update(names)
    for name in names:
        service.ask(name, name, before_ns)
    service.sent.clear()
    for name in names[-100:]:
        service.ask(name, name, before_ns)
    assert not service.sent
    service.ask(names[0], "forgotten", before_ns)
    assert service.sent == ["forgotten"]


def test_what_is_no_header_of_rclpy_tells_no_client():
    for header in (None, SimpleNamespace(), SimpleNamespace(request_id=7)):
        assert client_of(header) == b""


def test_other_warnings_are_given_as_before(monkeypatch):
    def send(response, header):
        warnings.warn("something else", DeprecationWarning, 2)

    one = SimpleNamespace(send_response=send, srv_name="/node/do")
    logger = SimpleNamespace(warning=sys.exit)
    give_up_on_clients_that_are_gone(SimpleNamespace(services=[one], get_logger=lambda: logger))
    with pytest.warns(DeprecationWarning, match="something else"):
        one.send_response(1, SimpleNamespace(received_timestamp=1))
