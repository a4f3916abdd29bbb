"""A successor that waits becomes the node that died; it never outlives what it waits for."""

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from hc_bringup.plan import NodePlan
from hc_bringup.processes import NodeProcess, describe_exit, end_all
from hc_bringup.runner import NodeDiedError
from hc_msgs_py.node_processes import Processes

NODE = """
import sys, time
from pathlib import Path

def prepare():
    Path("prepared").touch()

def main():
    print("node", *sys.argv[1:], repr(sys.stdin.readline()), flush=True)
    while True:
        time.sleep(0.1)

if __name__ == "__main__":
    sys.exit(main())
"""


@pytest.fixture(autouse=True)
def node_module(tmp_path, monkeypatch):
    (tmp_path / "a_node_of_ours.py").write_text(textwrap.dedent(NODE))
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def process(tmp_path, children):
    plan = NodePlan("a", "a_node_of_ours", parameters={"x": 1}, respawn=True)
    process = NodeProcess(plan, tmp_path)
    yield process
    end_all([process], asked=True)


def wait_for(condition, what):
    deadline = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < deadline, what
        time.sleep(0.02)


def lines(process):
    return process.tail().splitlines()


def kill(process):
    process.signal(signal.SIGKILL)
    wait_for(lambda: process.exit_status() is not None, "it still lives")


def all_children():
    """Processes that this one started and has not waited for."""
    found = set()
    for task in Path("/proc/self/task").iterdir():
        with contextlib.suppress(FileNotFoundError):  # a thread that has ended meanwhile
            found.update(map(int, (task / "children").read_text().split()))
    return found


@pytest.fixture
def children():
    """Tells which processes the test has started and not waited for.

    Without those of tests before it: joblib's helpers stay as long as the test process.
    """
    strangers = all_children()
    return lambda: all_children() - strangers


def test_the_successor_becomes_the_node_with_its_arguments(process, children, tmp_path):
    wait_for(lambda: lines(process), "no node")
    process.stand_by()
    (successor,) = children() - {process.pid}
    wait_for((tmp_path / "prepared").exists, "not prepared")
    process.stand_by()  # there is one
    assert children() == {process.pid, successor}
    kill(process)
    process.respawn()
    assert process.pid == successor
    wait_for(lambda: len(lines(process)) == 2, "no second node")
    first, second = lines(process)
    assert first == second
    assert first.startswith("node --ros-args -r __node:=a --params-file ")
    assert first.endswith("''")  # nothing on standard input
    assert process.stop() == -signal.SIGINT


def test_a_successor_that_is_dead_is_no_loss(process, children):
    wait_for(lambda: lines(process), "no node")
    process.stand_by()
    (successor,) = children() - {process.pid}
    os.kill(successor, signal.SIGKILL)
    time.sleep(0.2)
    kill(process)
    process.respawn()
    wait_for(lambda: len(lines(process)) == 2, "no second node")
    assert children() == {process.pid}


def test_a_successor_ends_with_the_run(process, children, tmp_path):
    wait_for(lambda: lines(process), "no node")
    process.stand_by()
    wait_for((tmp_path / "prepared").exists, "not prepared")
    end_all([process], asked=True)
    assert children() == set()


def test_a_successor_ends_when_whoever_waits_for_it_has_ended(tmp_path):
    with Processes(None, tmp_path) as processes:
        command = [sys.executable, "-m", "hc_bringup.standby", "a_node_of_ours"]
        waiting = processes.launch(command, stdin=subprocess.PIPE)
        wait_for((tmp_path / "prepared").exists, "not prepared")
        waiting.stdin.close()
        assert waiting.wait(10) == 0


def test_who_is_not_started_again_has_no_successor(children, tmp_path):
    process = NodeProcess(NodePlan("a", "a_node_of_ours"), tmp_path)
    process.stand_by()
    assert children() == {process.pid}
    end_all([process], asked=True)


def test_what_a_node_used_before_it_was_started_again_counts(process):
    """Regression: the use of the processor began anew, and was 0 % until it caught up."""
    wait_for(lambda: process.cpu_s() > 0.02, "it uses nothing")
    kill(process)
    used = process.cpu_s()
    process.respawn()
    wait_for(lambda: process.cpu_s() > used, "what it used is forgotten")


@pytest.mark.parametrize(
    ("status", "said"),
    [
        (-9, "was ended by SIGKILL"),
        (-40, "was ended by signal 40"),
        (3, "ended with exit status 3"),
    ],
)
def test_every_exit_status_has_words(status, said):
    """Regression: a real-time signal has no name, and was an internal error."""
    assert describe_exit(status) == said


@pytest.mark.parametrize(("status", "expected"), [(2, 2), (1, 1), (-9, 1)])
def test_a_node_that_refused_what_it_was_given_is_wrong_use(status: int, expected: int) -> None:
    """Regression: `hc run --filter nope` ended with 1, `hc estimate --filter nope` with 2."""
    assert NodeDiedError("estimator", status, "it said why").status == expected
