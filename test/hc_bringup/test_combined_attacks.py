"""Everything at once, as on a bad day: no node dies, and the estimates are right afterwards.

Two clients change parameters at random, a viewer of the live page stalls and another reads, command
lines look and are killed, the force sensor drops out, the system clock jumps by an hour and back,
the whole run sleeps, the recorder stands still for five seconds, and then the disk is full.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
import yaml

from hc_bringup.soak import endless
from hc_bringup.soak_disturbers import ParameterStorm, Viewers
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording

pytestmark = [pytest.mark.process, pytest.mark.timeout(600), pytest.mark.slow]

TRUE_STIFFNESS = 0.2
BLOCKS = 20_000
"""Of 512 bytes, that any file of the run may have: what half a minute of recording takes."""
NODES = ("hc_sim_rig.node", "hc_estimator.node", "hc_logger.recorder_node")
HOUR = 3600.0


class Live(threading.Thread):
    """Reads what a run says on standard error."""

    def __init__(self, process):
        super().__init__(daemon=True)
        self.process, self.lines = process, []
        self.start()

    def run(self):
        for line in self.process.stderr:
            self.lines.append(line)

    def wait_for(self, word, seconds):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            for line in self.lines:
                if word in line:
                    return line
            assert self.process.poll() is None, self.lines
            time.sleep(0.05)
        raise AssertionError(f"no {word!r} in {self.lines[-20:]}")


def scenario_with_dropouts(folder):
    """The multi-sine without an end, its force missing for 20 ms now and then."""
    path = endless(folder)
    data = yaml.safe_load(path.read_text(encoding="utf-8"))
    dropouts = {"probability": 0.0005, "mean_samples": 20.0, "reads": "nan"}
    data["sensors"]["force"]["dropouts"] = dropouts
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


def start(command_line):
    limit = ("sh", "-c", f'ulimit -f {BLOCKS}; exec "$@"', "sh")
    words = ["run", "--json", "--bag", "bag", "--dashboard", "--param", "indenter.scenario="]
    words[-1] += str(scenario_with_dropouts(command_line.folder))
    process = command_line.start(*words, through=limit)
    live = Live(process)
    page = next(w for w in live.wait_for("http://", 120.0).split() if w.startswith("http://"))
    live.wait_for("Hz", 120.0)
    return process, live, page


def sleep_all(pids, seconds):
    """Let processes stand still."""
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(seconds)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)


def wait_until_the_disk_is_full(command_line, live):
    bag = command_line.folder / "bag" / "bag_0.mcap"
    deadline = time.monotonic() + 180.0
    while bag.stat().st_size < 0.97 * BLOCKS * 512:
        assert time.monotonic() < deadline, (bag.stat().st_size, live.lines[-3:])
        time.sleep(0.2)
    live.wait_for("File too large", 30.0)


def test_everything_at_once(command_line, set_clock, monkeypatch):
    for name in ("ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE"):
        monkeypatch.setenv(name, command_line.environment[name])
    process, live, page = start(command_line)
    pids = {module: command_line.node_process(module) for module in NODES}
    assert None not in pids.values()
    command = [sys.executable, "-m", "hc_bringup.viewer_load", page, "1", "1"]
    looking = command_line.launch(command, env=None, stdin=subprocess.PIPE, stderr=None)
    with ParameterStorm(1) as one, ParameterStorm(2) as other, Viewers(3) as viewers:
        begin = time.monotonic()
        while not (one._first and other._first):  # both know what to go back to
            assert time.monotonic() < begin + 60.0
            time.sleep(0.1)
        one.active = other.active = True
        attacks = [
            lambda: set_clock(HOUR),
            lambda: sleep_all([pids["hc_logger.recorder_node"]], 5.0),
            lambda: set_clock(0.0),
            lambda: sleep_all(pids.values(), 3.0),
            lambda: set_clock(-HOUR),
            lambda: wait_until_the_disk_is_full(command_line, live),
            lambda: set_clock(0.0),
        ]
        for attack in attacks:
            attack()
            pause = time.monotonic() + 3.0
            while time.monotonic() < pause:
                viewers.look(time.monotonic() - begin)
                time.sleep(0.1)
            assert process.poll() is None, live.lines[-20:]
        one.active = other.active = False
        time.sleep(2.0)
        changes = one.taken + other.taken
    for _ in range(2):  # what the last filter of the storm believed is gone, the settings are back
        assert command_line.run("reset").returncode == 0
    time.sleep(15.0)
    assert {module: command_line.node_process(module) for module in NODES} == pids  # nobody died
    looking.stdin.close()
    told = looking.stdout.read().splitlines()
    assert looking.wait(20) == 0
    assert json.loads(told[-1])["bytes_per_second_each"] > 0
    process.send_signal(signal.SIGINT)
    process.wait(60)
    live.join(10.0)
    summary = json.loads(process.stdout.read())

    # What failed is said, and nothing else.
    reason = f"cannot write {command_line.folder / 'bag'}: File too large"
    assert process.returncode == 1
    assert summary["failures"] == [f"node recorder: {reason}"]
    assert live.lines[-1].startswith(f"hc run: node recorder: {reason}; ")
    assert "hc bag recover" in live.lines[-1]
    assert not any("Traceback" in line for line in live.lines)
    # The estimates went on, and are right.
    assert summary["respawns"] == 0
    assert changes > 100
    assert viewers.count > 2
    assert summary["parameters"]["stiffness"] == pytest.approx(TRUE_STIFFNESS, rel=0.01)
    # All that came before the disk was full is there, in order of its reception.
    recorded = read_recording(command_line.folder / "bag").sequence.astype(np.int64)
    assert len(recorded) > 10_000
    assert (np.diff(recorded) == 1).all()
    with BagReader(command_line.folder / "bag") as reader:
        times = np.array([m.log_time for m in reader.messages({"/indenter/sample"})])
    assert (np.diff(times) >= 0).all()
    assert all(command_line.node_process(module) is None for module in NODES)
