"""A command ends when a signal asks it to, whatever it does at that moment."""

import math
import os
import pty
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hc_bringup import cli, heartbeat, last_resort
from hc_bringup.compilation_notice import NOTICE
from hc_evaluation.workers import prepare_worker
from hc_msgs_py.node_processes import Processes

COMMAND = """
import ctypes, os, sys, time
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

last_resort.PATIENCE_S = {patience_s}
cli._module = lambda name: Module
cli.COMMANDS = ("work",)
sys.argv = ["hc", "work"]
sys.exit(entry.main())
"""
SHORT_S = 0.1
"""Patience with commands that never hear the signal, which use the processor so long."""
WORK = {
    "a sleep": "print('works', flush=True); time.sleep(3600.0)",
    # C calls us back, and the KeyboardInterrupt of a callback goes to nobody.
    "a callback": """ctypes.CFUNCTYPE(None)(
            lambda: print('works', flush=True) or time.sleep(3600.0))()
        time.sleep(3600.0)""",
    # One call that says that it works, goes on for ever, and keeps Python from answering: as a
    # compiler, which lets other threads run, and as a kernel, which does not.
    "a long call": "deque(map(os.write, repeat(1), chain([b'works\\n'], repeat(b''))), maxlen=0)",
    "a long kernel": "deque(chain(map(os.write, (1,), (b'works\\n',)), repeat(0)), maxlen=0)",
}


@pytest.fixture
def start(hears_hangups):
    with Processes(None) as processes:

        def begin(work, patience_s=last_resort.PATIENCE_S):
            return processes.start("-c", COMMAND.format(work=work, patience_s=patience_s))

        yield begin


def ended(command, number):
    """Send a signal once the command works; returns its status and what it said."""
    assert command.stdout.readline() == "works\n"
    return after_signal(command, number)


def after_signal(command, number):
    """Send a signal; returns the status of the command and what it said."""
    command.send_signal(number)
    said, errors = command.communicate()
    return command.returncode, said, errors


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("work", ["a sleep", "a callback"])
def test_a_command_that_hears_the_signal_ends_with_its_status(start, work, number):
    """Regression: llvmlite's callbacks lost it, with a traceback, and the compiler went on."""
    assert ended(start(WORK[work]), number) == (128 + number, "", "")


HALF = """
        from hc_logger.new_file import new_file
        with new_file(os.environ["HALF"]) as file:
            file.write(b"half of it")
            print("works", flush=True)
            try:
                time.sleep(3600.0)
            finally:
                time.sleep(0.3)  # the second SIGHUP comes into what is put away
"""


def test_a_closed_terminal_leaves_no_half_file(tmp_path, hears_hangups):
    """Regression: a hidden file, or a bag without an index, stayed of what was converted."""
    command, terminal = pty.fork()
    if command == 0:
        os.environ["HALF"] = str(tmp_path / "whole.csv")
        code = COMMAND.format(work=HALF.strip(), patience_s=last_resort.PATIENCE_S)
        os.execv(sys.executable, [sys.executable, "-c", code])
    assert b"works" in os.read(terminal, 100)
    assert len(list(tmp_path.iterdir())) == 1
    os.kill(command, signal.SIGHUP)  # as the shell does before the kernel
    time.sleep(0.1)
    os.close(terminal)
    assert os.waitstatus_to_exitcode(os.waitpid(command, 0)[1]) == 128 + signal.SIGHUP
    assert list(tmp_path.iterdir()) == []


def test_who_reads_the_errors_elsewhere_hears_that_the_terminal_was_closed(start):
    assert ended(start(WORK["a sleep"]), signal.SIGHUP) == (129, "", f"hc: {cli.HUNG_UP}\n")


def test_under_nohup_a_command_goes_on(start):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        command = start("print('works', flush=True); time.sleep(0.5); print('done'); return 0")
    finally:
        signal.signal(signal.SIGHUP, before)
    assert ended(command, signal.SIGHUP) == (0, "done\n", "")


def test_workers_leave_the_end_of_the_terminal_to_the_main_process():
    """Regression: a batch whose terminal was closed lost its workers, and did not gather."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGHUP)}
    try:
        prepare_worker(os.getppid())
        assert {signal.getsignal(number) for number in before} == {signal.SIG_IGN}
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def test_one_that_is_in_a_long_call_ends_with_the_status_of_the_signal(start):
    status, said, errors = ended(start(WORK["a long call"], SHORT_S), signal.SIGINT)
    assert (status, said) == (128 + signal.SIGINT, "")
    assert errors == "hc work: ended at once: it was too busy to end in order\n"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_one_that_cannot_hear_it_is_ended_all_the_same(start, number):
    """Regression: hc setup on a busy machine went on for ten seconds after a SIGTERM."""
    status, said, errors = ended(start(WORK["a long kernel"], SHORT_S), number)
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
            sum(range(2 * 10**7))
        print('away', flush=True)
        return 0
"""
    command = start(work.strip(), SHORT_S)
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


def cpu_s(process_id: int) -> float:
    """Processor time that a process has used."""
    fields = Path(f"/proc/{process_id}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.timeout(600)
@pytest.mark.parametrize("after_s", [4.0, 9.0, 14.0])
@pytest.mark.parametrize(
    "words",
    [("estimate", "a.csv"), ("batch", "a.csv", "-o", "out", "-j", "2")],
    ids=["estimate", "batch"],
)
def test_interrupted_while_it_compiles_it_ends_with_a_line_at_most(
    tmp_path: Path, words: tuple[str, ...], after_s: float
) -> None:
    """With no kernel in the cache the compiler is at work from the third second or so on."""
    depths = [(k / 500, 2.0 + math.sin(k / 160)) for k in range(2000)]
    rows = "".join(f"{time_s},{d},{0.3 * d**1.6}\n" for time_s, d in depths)
    (tmp_path / "a.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}")
    with Processes(None, tmp_path, NUMBA_CACHE_DIR=str(tmp_path / "kernels")) as processes:
        command = processes.start("-m", "hc_bringup", *words)
        while cpu_s(command.pid) < after_s:
            assert command.poll() is None
            time.sleep(0.02)
        status, said, errors = after_signal(command, signal.SIGINT)
    assert (status, said) == (128 + signal.SIGINT, "")
    busy = f"hc {words[0]}: ended at once: it was too busy to end in order"
    lines = [line for line in errors.splitlines() if not line.startswith(heartbeat.MARK)]
    assert [line for line in lines if line != NOTICE] in ([], [busy])


def test_the_end_of_a_run_waits_for_no_library_that_it_does_without() -> None:
    """Three seconds of imports, after Ctrl-C, for a constant and a quantile."""
    script = (
        "import sys\nimport hc_bringup.run_ending\n"
        "slow = {'scipy.signal', 'scipy.stats', 'scipy.interpolate', 'scipy.optimize'}\n"
        "slow |= {'scipy.spatial', 'sklearn', 'matplotlib'}\n"
        "assert not slow & set(sys.modules), slow & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
