"""Real-time scheduling: what is asked for is done, and what is not permitted is said."""

import errno
import os
import subprocess
import sys

import pytest

from hc_msgs_py import realtime
from hc_msgs_py.realtime import RealtimeError

NODE = """
import gc, os, sys, threading, time
from pathlib import Path
from rclpy.node import Node
from hc_msgs_py.node_main import run_node

class Example(Node):
    def __init__(self):
        super().__init__("example")
        threading.Thread(target=time.sleep, args=(1000,), daemon=True, name="compiler").start()
    def finished(self):
        kinds = {os.sched_getscheduler(int(t.name)) for t in Path("/proc/self/task").iterdir()}
        others = [t for t in threading.enumerate() if t.name == "compiler"]
        locked = Path("/proc/self/status").read_text().split("VmLck:")[1].split()[0]
        print(os.sched_getscheduler(0), os.sched_getparam(0).sched_priority, gc.isenabled(),
              int(locked) > 1000, os.sched_getscheduler(others[0].native_id), len(kinds),
              *os.sched_getaffinity(0))
        return True
    def close(self):
        pass

sys.exit(run_node(Example))
"""


def permitted():
    try:
        realtime.check_permission()
    except RealtimeError:
        return False
    return True


def run(ros_domain, **variables):
    environment = os.environ | {"ROS_DOMAIN_ID": str(ros_domain)} | variables
    return subprocess.run(
        [sys.executable, "-c", NODE], env=environment, capture_output=True, text=True, timeout=60
    )


@pytest.mark.process
@pytest.mark.skipif(not permitted(), reason="the system permits no real-time scheduling here")
def test_a_node_is_scheduled_as_the_environment_asks(ros_domain):
    cpu = max(os.sched_getaffinity(0))
    done = run(ros_domain, HC_REALTIME="7", HC_CPUS=str(cpu))
    fifo, other = int(os.SCHED_FIFO), int(os.SCHED_OTHER)
    assert done.stdout.split() == [str(fifo), "7", "False", "True", str(other), "2", str(cpu)]
    assert done.stderr == ""


@pytest.mark.process
def test_without_being_asked_nothing_is_done(ros_domain):
    done = run(ros_domain, HC_REALTIME="", HC_CPUS="")
    other = str(int(os.SCHED_OTHER))
    assert done.stdout.split()[:6] == [other, "0", "True", "False", other, "1"]


@pytest.mark.process
def test_what_is_no_priority_ends_the_node_in_one_line(ros_domain):
    done = run(ros_domain, HC_REALTIME="often")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "HC_REALTIME is 'often', not a whole number from 1 to 99\n"


@pytest.mark.parametrize("text", ["", "x", "0-", "-1", "1,,2", "3-1", "99999", "0-99998", "1e2"])
def test_lists_that_name_no_processors_of_this_machine(text):
    with pytest.raises(RealtimeError, match="processors"):
        realtime.processors(text)


def test_a_list_of_processors():
    allowed = sorted(os.sched_getaffinity(0))
    assert realtime.processors(f"{allowed[0]}-{allowed[0]}") == {allowed[0]}
    if len(allowed) > 1 and allowed[1] == allowed[0] + 1:
        assert realtime.processors(f"{allowed[0]}-{allowed[1]}") == set(allowed[:2])


def test_what_is_not_permitted_is_said_with_the_way_out(monkeypatch):
    def refuse(*_arguments):
        raise PermissionError(errno.EPERM, "no")

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    with pytest.raises(RealtimeError, match=r"not permitted; `ulimit -r 99` .* permits it"):
        realtime.check_permission()


def test_memory_that_may_not_be_locked_is_said_with_the_way_out(monkeypatch):
    class Libc:
        def mlockall(self, _flags):
            import ctypes

            ctypes.set_errno(errno.ENOMEM)
            return -1

    monkeypatch.setattr(realtime, "_libc", Libc)
    monkeypatch.setattr(os, "sched_setscheduler", lambda *_: None)
    with pytest.raises(RealtimeError, match=r"Cannot allocate memory; `ulimit -l unlimited`"):
        realtime.check_permission()
