"""Processes in a domain: their words, their environment, and that they always end."""

from __future__ import annotations

import signal
import subprocess

import pytest

from hc_msgs_py.node_processes import Caller, Processes, end, ros_arguments

STUBBORN = "import signal, sys, time\nsignal.signal(2, signal.SIG_IGN)\nprint(1, flush=True)\n"


def test_parameters_become_words() -> None:
    words = ros_arguments({"input__rate": 5, "paused": True}, "-r", "__node:=a")
    assert words == ["--ros-args", "-r", "__node:=a", "-p", "input.rate:=5", "-p", "paused:=true"]


@pytest.mark.process
def test_processes_get_their_domain_and_end() -> None:
    with Processes(7, COLUMNS="100") as processes:
        told = processes.start(
            "-c",
            "import os; print(*(os.environ[n] for n in ('ROS_DOMAIN_ID', 'COLUMNS', 'X')))",
            X="y",
        )
        assert end(told, 0)[:2] == (0, "7 100 y\n")
        waits = processes.start("-c", "import time; time.sleep(100)", stderr=subprocess.DEVNULL)
    assert waits.returncode == -signal.SIGINT


@pytest.mark.process
def test_what_does_not_end_is_killed() -> None:
    with Processes(7) as processes:
        stubborn = processes.start("-c", STUBBORN + "time.sleep(100)")
        assert stubborn.stdout is not None
        assert stubborn.stdout.readline() == "1\n"
        assert end(stubborn, timeout_s=0.3)[0] == -signal.SIGKILL


def test_a_service_that_nobody_has_gives_no_answer(ros_domain: int) -> None:
    from std_srvs.srv import Trigger

    caller = Caller(ros_domain, "caller")
    try:
        assert caller.ask(Trigger, "/nobody/ready", timeout_s=0.2) is None
        with pytest.raises(
            AssertionError, match=r"no answer of service /nobody/ready within 0\.2 s"
        ):
            caller.call(Trigger, "/nobody/ready", timeout_s=0.2)
    finally:
        caller.close()
