"""How every node starts, declares parameters, tells how it is, and ends."""

import signal
import time

import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.parameter import Parameter
from std_srvs.srv import Trigger

from hc_msgs_py.diagnostics import DiagnosticsPublisher, Level, Status
from hc_msgs_py.node_processes import wait
from hc_msgs_py.parameters import declare
from hc_msgs_py.services import add_ready_service

SCRIPT = """
import sys
import time
from rclpy.node import Node
from hc_msgs_py.node_main import NodeStartError, run_node
from hc_msgs_py.node_processes import wait
from hc_msgs_py.parameters import declare

class Example(Node):
    def __init__(self):
        super().__init__("example")
        self.count = declare(self, "count", 3, "how often", minimum=1, maximum=9)
        if self.count == 9:
            raise TypeError("a slip in\\nthe making")
        if self.count == 7:
            raise NodeStartError("seven is\\nnot possible")
        self.ticks = 0
        self.create_timer(0.02, self.tick)
        print("up", flush=True)
    def tick(self):
        self.ticks += 1
        if self.count == 6:
            raise KeyError("a slip")
    def finished(self):
        if self.count == 8 and self.ticks > 2:
            raise NodeStartError("it broke later")
        return self.count == 5 and self.ticks > 2
    def close(self):
        if self.count == 4:
            time.sleep(0.5)
        print("closed", flush=True)

sys.exit(
    run_node(
        Example,
        at_clean_end=lambda node: print("clean", flush=True),
        at_hang_up=lambda node: print("left alone", flush=True),
    )
)
"""


BUSY = """
import sys
from rclpy.node import Node
from std_msgs.msg import Float64
from hc_msgs_py.node_main import run_node

class Busy(Node):
    # Ten messages go round and round: there is never a moment in which none waits.
    def __init__(self):
        super().__init__("busy")
        self.looks = self.count = 0
        self.create_subscription(Float64, "round", self.again, 1000, raw=True)
        self.publisher = self.create_publisher(Float64, "round", 1000)
        self.timer = self.create_timer(0.05, self.begin)
    def begin(self):
        if self.publisher.get_subscription_count():
            self.timer.cancel()
            for _ in range(10):
                self.publisher.publish(Float64())
            print("up", flush=True)
    def again(self, message):
        self.count += 1
        self.publisher.publish(message)
    def finished(self):
        self.looks += self.count > 0
        return self.looks > 20 and "finishes" in sys.argv
    def close(self):
        print("busy" if self.count > 100 else "not busy", flush=True)

sys.exit(run_node(Busy))
"""


def run(processes, *arguments, stop=(), **environment):
    process = processes.start("-c", SCRIPT, "--ros-args", *arguments, **environment)
    if stop:
        assert process.stdout.readline() == "up\n"
        time.sleep(0.2)
        for number in stop:
            process.send_signal(number)
            time.sleep(0.1)
    return wait(process, 30.0)


@pytest.mark.process
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_node_cleanly(processes, number):
    status, output, errors = run(processes, stop=[number])
    assert (status, output, errors) == (0, "closed\nclean\n", "")


@pytest.mark.process
@pytest.mark.parametrize("ends", ["by a signal", "by itself"])
def test_a_node_that_always_has_something_to_do_ends_all_the_same(processes, ends):
    """The executor goes from one event to the next, and looks at nothing else while some wait."""
    process = processes.start("-c", BUSY, *["finishes"] * (ends == "by itself"))
    assert process.stdout.readline() == "up\n"
    if ends == "by a signal":
        time.sleep(0.3)
        process.send_signal(signal.SIGTERM)
    assert wait(process, 30.0) == (0, "busy\n", "")


LOGS = """
import inspect
import sys
from rclpy.node import Node
from hc_msgs_py.node_main import run_node

class Logs(Node):
    def __init__(self):
        super().__init__("logs")
        self.done = False
        self.create_timer(0.02, self.tick)
    def tick(self):
        searched, search = [], inspect.getabsfile
        inspect.getabsfile = lambda *a: searched.append(a) or search(*a)
        self.get_logger().info("first line")
        if not self.done:
            print(len(searched), flush=True)
        self.done = True
    def finished(self):
        return self.done
    def close(self):
        pass

sys.exit(run_node(Logs))
"""


@pytest.mark.process
def test_the_first_line_of_a_log_searches_no_modules_while_samples_come(processes):
    """It took 60 ms: rclpy went through some thousand modules for the place that logs."""
    status, output, errors = wait(processes.start("-c", LOGS), 30.0)
    assert status == 0
    assert "first line" in errors
    assert int(output) < 10


@pytest.mark.process
def test_a_node_that_lost_its_runner_closes_and_does_not_take_it_for_a_clean_end(processes):
    """A runner that is killed sends a signal for each of its threads: the second ended the node."""
    status, output, errors = run(processes, "-p", "count:=4", stop=3 * [signal.SIGHUP])
    assert (status, output, errors) == (0, "closed\nleft alone\n", "")


@pytest.mark.process
@pytest.mark.parametrize(
    ("arguments", "status", "output", "errors"),
    [
        (("-p", "count:=5"), 0, "up\nclosed\nclean\n", ""),
        (("-p", "count:=7"), 2, "", "seven is not possible\n"),
        (("-p", "count:=8"), 1, "up\nclosed\n", "it broke later\n"),
        (
            ("-p", "count:=0"),
            2,
            "",
            "parameter count = 0 is not an integer from 1 to 9\n",
        ),
        (("-p", "count:=many"), 2, "", "parameter count = 'many' is not an integer from 1 to 9\n"),
        (
            ("-p", "name:=\udcff"),
            2,
            "",
            "an argument is not in UTF-8: 'name:=\\udcff'\n",
        ),
        (("--nonsense",), 2, "", None),
    ],
)
def test_ways_to_end_have_their_status_and_one_line(processes, arguments, status, output, errors):
    got_status, got_output, got_errors = run(processes, *arguments)
    assert (got_status, got_output) == (status, output)
    if errors is None:
        assert got_errors.count("\n") == 1
        assert "nonsense" in got_errors
    else:
        assert got_errors == errors


@pytest.mark.process
def test_a_node_that_cannot_be_made_is_one_line_and_a_file(processes, tmp_path):
    status, output, errors = run(processes, "-p", "count:=9", ROS_LOG_DIR=str(tmp_path))
    assert (status, output, errors.count("\n")) == (1, "", 1)
    assert errors.startswith("the node failed: TypeError: a slip in the making (where: ")
    (file,) = tmp_path.glob("failure_*.txt")
    assert str(file) in errors


@pytest.mark.process
def test_a_callback_that_raises_is_one_line_a_file_and_no_clean_end(processes, tmp_path):
    status, output, errors = run(processes, "-p", "count:=6", ROS_LOG_DIR=str(tmp_path))
    assert (status, output) == (1, "up\nclosed\n")
    assert "Traceback" not in errors
    last = errors.splitlines()[-1]
    assert last.startswith("the node failed: KeyError: 'a slip' (where: ")
    (file,) = tmp_path.glob("failure_*.txt")
    assert str(file) in last
    assert 'raise KeyError("a slip")' in file.read_text() or "in tick" in file.read_text()


@pytest.fixture
def node(monkeypatch, ros_domain):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    context = rclpy.Context()
    rclpy.init(args=[], context=context, domain_id=ros_domain)
    node = rclpy.create_node("example", context=context, enable_rosout=False)
    executor = rclpy.executors.SingleThreadedExecutor(context=context)
    executor.add_node(node)
    node.spin_until = lambda condition, timeout_s=10.0: _spin(executor, condition, timeout_s)
    yield node
    executor.shutdown()
    node.destroy_node()
    context.try_shutdown()


def _spin(executor, condition, timeout_s):
    end = time.monotonic() + timeout_s
    while not condition():
        assert time.monotonic() < end, "not in time"
        executor.spin_once(timeout_sec=0.05)


def test_declared_parameters_carry_description_unit_range_and_mark(node):
    assert declare(node, "gain", 0.5, "how much", minimum=0.0, maximum=1.0, unit="N") == 0.5
    assert declare(node, "word", "a", "which", choices=("a", "b"), read_only=True) == "a"
    gain, word = node.describe_parameter("gain"), node.describe_parameter("word")
    assert gain.description == "how much [N]"
    assert (gain.floating_point_range[0].from_value, gain.floating_point_range[0].to_value) == (
        0.0,
        1.0,
    )
    assert word.read_only
    assert word.additional_constraints == "one of: a, b"
    assert not node.set_parameters([Parameter("gain", value=2.0)])[0].successful
    assert not node.set_parameters([Parameter("word", value="b")])[0].successful


def test_an_integer_with_half_a_range_takes_every_number_of_it(node):
    declare(node, "seed", 1, "seed", minimum=0)
    for value in (0, 1, 12345, 2**62):
        assert node.set_parameters([Parameter("seed", value=value)])[0].successful, value
    assert not node.set_parameters([Parameter("seed", value=-1)])[0].successful


def test_ready_says_what_is_missing(node):
    missing = ["no publisher", "no subscriber"]
    add_ready_service(node, lambda: missing)
    client = node.create_client(Trigger, "/example/ready")
    node.spin_until(client.service_is_ready)
    future = client.call_async(Trigger.Request())
    node.spin_until(future.done)
    answer = future.result()
    assert (answer.success, answer.message) == (False, "no publisher; no subscriber")
    missing.clear()
    future = client.call_async(Trigger.Request())
    node.spin_until(future.done)
    assert (future.result().success, future.result().message) == (True, "ready")


def test_diagnostics_come_by_themselves_even_while_simulated_time_stands_still(node):
    received = []
    node.create_subscription(DiagnosticArray, "/diagnostics", received.append, 10)
    node.set_parameters([Parameter("use_sim_time", value=True)])
    status = Status(Level.WARN, "half full", {"rate_hz": 999.123456789, "count": 3})
    DiagnosticsPublisher(node, "glass", lambda: status)
    node.spin_until(lambda: received)
    (told,) = received[0].status
    assert (told.level, told.name, told.hardware_id) == (b"\x01", "example", "glass")
    values = {v.key: v.value for v in told.values}
    assert float(values.pop("cpu_percent")) >= 0.0
    assert values == {"rate_hz": "999.123", "count": "3"}


def test_a_status_that_is_due_waits_for_a_pause_and_is_published_without_one(node):
    """Collected and sent when its time came, it stood in the way of a sample every other second."""
    received = []
    node.create_subscription(DiagnosticArray, "/diagnostics", received.append, 10)
    collected = []

    def collect():
        collected.append(len(collected))
        return Status(Level.OK, f"status {len(collected)}", {})

    diagnostics = DiagnosticsPublisher(node, "glass", collect, in_parts=True)
    node.spin_until(lambda: diagnostics.due)
    assert not collected
    diagnostics.go_on()
    assert collected == [0]
    assert diagnostics.due
    diagnostics.publish()  # somebody wants one now: what was collected is not lost
    assert not diagnostics.due
    node.spin_until(lambda: len(received) == 2)
    assert [m.status[0].message for m in received] == ["status 1", "status 2"]
    node.spin_until(lambda: diagnostics.due)
    diagnostics.publish_overdue()  # not yet
    assert diagnostics.due

    def is_published():
        diagnostics.publish_overdue()
        return not diagnostics.due

    node.spin_until(is_published)
    node.spin_until(lambda: len(received) == 3)
    assert collected == [0, 1, 2]


def test_a_whole_number_is_a_number(node):
    """`zero: 5` in a parameter file is what people write."""
    given = rclpy.create_node(
        "given",
        context=node.context,
        enable_rosout=False,
        parameter_overrides=[Parameter("gain", value=-2), Parameter("high", value=9)],
    )
    try:
        value = declare(given, "gain", 0.5, "how much", minimum=-3.0, maximum=1.0)
        assert (value, type(value)) == (-2.0, float)
        with pytest.raises(ValueError, match=r"high = 9\.0 is not a number"):
            declare(given, "high", 0.5, "how much", minimum=-3.0, maximum=1.0)
    finally:
        given.destroy_node()
