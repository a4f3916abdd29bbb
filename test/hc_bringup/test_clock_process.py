"""The system clock is set while a run goes on: forwards, backwards, by a leap second."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from hc_msgs.msg import EstimatorEvent
from rclpy.serialization import deserialize_message

from hc_estimator.stream.vocabulary import EventKind
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording

HOUR, LEAP = 3600.0, 1.0

pytestmark = [pytest.mark.process, pytest.mark.timeout(300), pytest.mark.slow]


def test_a_run_goes_on_however_the_clock_is_set(command_line, set_clock) -> None:
    """Set back, the wheels once slept through the hour: no timer, no signal, nothing recorded."""
    process = command_line.start("run", "--json", "--bag", "bag")
    for line in process.stderr:
        if "Hz" in line:
            break
    for seconds in (HOUR, 0.0, -LEAP, -HOUR):
        time.sleep(1.5)
        set_clock(seconds)
    time.sleep(2.0)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["samples"] > 4000
    assert summary["lost"] < 0.02 * summary["samples"]
    assert summary["rejected"].get("time_backward", 0) == 0
    assert summary["parameters"]["stiffness"] == pytest.approx(0.2, rel=0.02)
    bag = command_line.folder / "bag"
    with BagReader(bag) as reader:
        assert len(reader.custom_data["clock_jumps_s"].split(", ")) >= 4
        times = np.array([m.log_time for m in reader.messages({"/indenter/sample"})])
    # The times of reception go on evenly: a player makes neither a hole nor a fold of it.
    assert (np.diff(times) >= 0).all()
    assert np.diff(times).max() < 1e9
    recorded = read_recording(bag).sequence
    assert len(recorded) > 0.98 * summary["samples"]


WAIT = """
import os, struct, sys, time
import rclpy
from rclpy.experimental import EventsExecutor
from hc_msgs_py.clock_watch import ClockWatch
from hc_msgs_py.middleware import set_defaults
set_defaults()
rclpy.init()
node = rclpy.create_node("waits")
ticks = []
node.create_timer(0.05, lambda: ticks.append(time.monotonic()))
executor = EventsExecutor()
executor.add_node(node)
def spin(seconds):
    end = time.monotonic() + seconds
    while (left := end - time.monotonic()) > 0:
        executor.spin_once(timeout_sec=min(left, 0.1))
with ClockWatch(executor, lambda: node.timers) as watch:
    spin(1.0)
    before = len(ticks)
    with open(os.environ["HC_TEST_CLOCK"], "r+b", buffering=0) as file:
        file.write(struct.pack("<q", -3600 * 10**9))
    begin = time.monotonic()
    spin(2.0)
    print(before, len(ticks) - before, watch.steps_back, time.monotonic() - begin)
"""


def test_timers_go_on_when_the_clock_is_set_back(command_line, set_clock) -> None:
    done = subprocess.run(
        [sys.executable, "-c", WAIT],
        env=os.environ | command_line.environment,
        capture_output=True,
        text=True,
        timeout=30,
    )
    before, after, steps, took = map(float, done.stdout.split())
    assert before > 5
    assert after > 10
    assert steps == 1
    assert took < 4.0


ASLEEP_S = 10.0
UNTRUE = {
    EventKind.TISSUE_CHANGE,
    EventKind.SOURCE_RESTARTED,
    EventKind.SOURCE_CONFLICT,
    EventKind.INPUT_FROZEN,
    EventKind.INPUT_SATURATED,
    EventKind.MODEL_MISMATCH,
    EventKind.INPUT_SUSPECT,
}
"""What did not happen while a run slept, and so is not to be told."""


@pytest.mark.parametrize("jump_s", [0.0, 600.0])
def test_a_run_that_was_put_to_sleep_goes_on(command_line, set_clock, jump_s: float) -> None:
    """Runner and nodes stand still for 10 s, as a laptop with a closed lid; the clock may jump.

    It was told of latencies of 615 s then, for ever.
    """
    process = command_line.start("run", "--scenario", "multisine", "--json", "--bag", "bag")
    seconds = (line for line in process.stderr if "Hz" in line)
    for _ in range(5):
        next(seconds)
    modules = ("hc_sim_rig.node", "hc_estimator.node", "hc_logger.recorder_node")
    pids = [process.pid, *map(command_line.node_process, modules)]
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    asleep_ns = time.time_ns()
    time.sleep(ASLEEP_S)
    set_clock(jump_s)
    for pid in pids:
        os.kill(pid, signal.SIGCONT)
    for _ in range(8):
        next(seconds)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert summary["respawns"] == 0
    assert sum(summary["rejected"].values()) < 0.01 * summary["samples"]
    assert "time_backward" not in summary["rejected"]
    assert summary["changes_detected"] == 0
    assert summary["latency_us"]["max"] < 1e6 * (ASLEEP_S + 20.0)  # what came late, and no clock
    # The rig catches up at once: on a busy machine some of that overflows a socket, and is counted.
    assert summary["lost"] < 0.1 * summary["samples"]
    bag = command_line.folder / "bag"
    recording = read_recording(bag)
    afterwards = recording.estimates[-summary["estimates"] // 4 :]
    assert recording.stamps[-1] > asleep_ns
    np.testing.assert_allclose(afterwards["stiffness"], 0.2, rtol=0.01)
    with BagReader(bag) as reader:
        told = [
            deserialize_message(message.data, EstimatorEvent)
            for message in reader.messages({"/hc/events"})
        ]
    assert UNTRUE.isdisjoint(event.kind for event in told), told
    assert EventKind.CONTACT_MADE in {event.kind for event in told}
