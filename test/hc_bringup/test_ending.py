"""A command ends when a signal asks it to, whatever it does at that moment."""

import signal

import pytest

from hc_msgs_py.node_processes import Processes

COMMAND = """
import os, sys, time
from collections import deque
from itertools import chain, repeat
from hc_bringup import cli, entry, heartbeat, last_resort

class Module:
    HELP = "works"
    HEARTBEAT = True
    @staticmethod
    def configure(parser): pass
    @staticmethod
    def run(arguments):
        {work}

cli._module = lambda name: Module
cli.COMMANDS = ("work",)
sys.argv = ["hc", "work"]
sys.exit(entry.main())
"""
WORK = {
    "a sleep": "print('works', flush=True); time.sleep(3600.0)",
    # One call that says that it works, goes on for ever, and keeps Python from answering.
    "a long kernel": "deque(map(os.write, repeat(1), chain([b'works\\n'], repeat(b''))), maxlen=0)",
}


@pytest.fixture
def start():
    with Processes(None) as processes:
        yield lambda work: processes.start("-c", COMMAND.format(work=work))


def ended(command, number):
    """Send a signal once the command works; returns its status and what it said."""
    assert command.stdout.readline() == "works\n"
    command.send_signal(number)
    said, errors = command.communicate()
    return command.returncode, said, errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_command_that_hears_the_signal_ends_with_its_status(start, number):
    assert ended(start(WORK["a sleep"]), number) == (128 + number, "", "")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_one_that_cannot_hear_it_is_ended_all_the_same(start, number):
    """Regression: hc setup on a busy machine went on for ten seconds after a SIGTERM."""
    status, said, errors = ended(start(WORK["a long kernel"]), number)
    assert (status, said) == (-signal.SIGKILL, "")
    assert errors == "hc work: ended at once: it was too busy to end in order\n"


def test_what_puts_its_things_away_itself_is_left_to_it(start):
    """As the runner does, which ends its nodes first."""
    work = """
        last_resort.disarm()
        heartbeat.nothing()
        import signal
        ended = []
        signal.signal(signal.SIGTERM, lambda *_: ended.append(1))
        print('works', flush=True)
        while not ended:
            sum(range(10**8))
        print('away', flush=True)
        return 0
"""
    command = start(work.strip())
    assert ended(command, signal.SIGTERM) == (0, "away\n", "")


def test_a_command_that_is_done_leaves_nobody_behind(start):
    command = start("print('works', flush=True); return 3")
    said, errors = command.communicate()  # to the end of both streams: nobody holds them open
    assert (command.returncode, said, errors) == (3, "works\n", "")


def test_a_step_that_lasts_is_told_while_it_lasts(start):
    work = """
        heartbeat.doing('thinking')
        while heartbeat._heartbeat._spoken < heartbeat._heartbeat._since:
            time.sleep(0.05)
        print('works', flush=True)
        return 0
"""
    command = start(work.strip())
    said, errors = command.communicate()
    assert (command.returncode, said) == (0, "works\n")
    assert errors.startswith("... thinking, since ")
    assert errors.count("\n") == 1
