"""A second run in a domain, beside one that is stopped."""

import os
import signal
import subprocess
import sys
import time

import pytest

from hc_bringup import cli
from hc_bringup.domain_lock import DomainLock, domain_id, elsewhere_hint
from hc_bringup.errors import UserError
from hc_bringup.process_state import is_stopped
from hc_bringup.reach import speak_to_nodes

HOLDS = (
    "import sys, time; from hc_bringup.domain_lock import DomainLock\n"
    "with DomainLock(int(sys.argv[1])): print('held', flush=True); time.sleep(600)"
)


@pytest.mark.parametrize("number", ["abc", "999", "-1", "7 7", "9" * 5000])
@pytest.mark.parametrize("ask", [domain_id, speak_to_nodes])
def test_what_is_no_domain_is_refused_alike_everywhere(monkeypatch, ask, number):
    """Regression: "internal error: RCLError", or some other domain, by all commands but hc run."""
    monkeypatch.setenv("ROS_DOMAIN_ID", number)
    told = r"ROS_DOMAIN_ID='.*' is no domain: give a number from 0 to 232"
    with pytest.raises(UserError, match=told):
        ask()


@pytest.mark.parametrize("words", [["record", "--all"], ["dashboard"]])
def test_commands_that_are_nodes_refuse_it_before_they_say_anything(monkeypatch, capsys, words):
    monkeypatch.setenv("ROS_DOMAIN_ID", "999")
    assert cli.main(words) == 2
    said = capsys.readouterr()
    expected = f"hc {words[0]}: ROS_DOMAIN_ID='999' is no domain: give a number from 0 to 232\n"
    assert (said.out, said.err) == ("", expected)


@pytest.mark.process
def test_a_node_refuses_what_is_no_domain():
    for module in ("hc_logger.recorder_node", "hc_bringup.dashboard.node"):
        done = subprocess.run(
            [sys.executable, "-m", module],
            env={**os.environ, "ROS_DOMAIN_ID": "7 7"},
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 2
        assert done.stderr == "ROS_DOMAIN_ID='7 7' is no domain: give a number from 0 to 232\n"


@pytest.mark.process
def test_beside_a_stopped_run_it_is_said_how_that_ends(processes, ros_domain):
    """Regression: "end it first", of a process that no Ctrl-C and no kill would end."""
    held = processes.start("-c", HOLDS, str(ros_domain))
    try:
        assert held.stdout.readline() == "held\n"
        told = f"process {held.pid} .*: end it first.*a second robot in this one: a node"
        with pytest.raises(UserError, match=told):
            DomainLock(ros_domain).__enter__()
        os.kill(held.pid, signal.SIGSTOP)
        while not is_stopped(held.pid):
            time.sleep(0.01)
        way_out = f"kill -CONT {held.pid} lets it go on, kill -9 ends it, or take another domain"
        with pytest.raises(UserError, match=f"it is stopped: {way_out}"):
            DomainLock(ros_domain).__enter__()
    finally:
        held.kill()
        held.wait()
    with pytest.raises(OSError, match="No such"):
        is_stopped(held.pid)


@pytest.mark.process
def test_who_sees_nothing_is_told_of_a_run_in_another_domain(processes, ros_domain, monkeypatch):
    """Two terminals of which one has another ROS_DOMAIN_ID: "running nodes: none" was all."""
    held = processes.start("-c", HOLDS, str(ros_domain))
    try:
        assert held.stdout.readline() == "held\n"
        other = 0 if ros_domain else 1
        monkeypatch.setenv("ROS_DOMAIN_ID", str(other))
        said = elsewhere_hint()
        assert said.startswith(f"; this is ROS domain {other}, and there is ")
        assert f"process {held.pid} in domain {ros_domain}" in said
        monkeypatch.setenv("ROS_DOMAIN_ID", str(ros_domain))
        assert f"process {held.pid} " not in elsewhere_hint()
    finally:
        held.kill()
        held.wait()
    monkeypatch.setenv("ROS_DOMAIN_ID", str(other))
    assert f"process {held.pid} " not in elsewhere_hint()
