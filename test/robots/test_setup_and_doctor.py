"""hc setup and hc doctor on a robot that nobody has described, and on what is set up wrongly."""

import io
import json
import re
import signal
import sys
import time

import numpy as np
import pytest
import yaml

from hc_bringup.guided_setup import LiveLine
from hc_estimator.contact.hunt_crossley import hunt_crossley_force

pytestmark = [pytest.mark.process, pytest.mark.timeout(600)]

ROBOT = {
    "rest_s": 0.5,
    "force": {"bias": [0.3, -1.1, 4.2], "reaction": -1, "jitter_s": 0.002},
    "position": {"jitter_s": 0.004},
}


@pytest.mark.slow
def test_setup_finds_the_robot_writes_it_down_and_doctor_finds_nothing_or_the_fault(bench):
    bench.robot(**ROBOT)
    done = bench.patiently("setup", "--yes", "--no-run", "--seconds", "10", "-o", "arm")
    assert done.returncode == 0, done.stderr
    # Without a terminal, too, it is said when to press.
    told = "recording /ft_sensor/wrench and /tool_pose for 10 s: press into the tissue"
    assert told in " ".join(done.stdout.split())
    assert "hc run arm_run.yaml" in done.stdout
    settings = yaml.safe_load((bench.folder / "arm.yaml").read_text())
    found = settings["estimator"]["ros__parameters"]["input"]
    assert found["source"] == "sensors"
    force, position = found["force"], found["position"]
    assert (force["topic"], force["axis"], force["sign"]) == ("/ft_sensor/wrench", "z", -1)
    assert force["zero"] == pytest.approx(-4.2, abs=0.05)
    assert (position["type"], position["axis"], position["sign"]) == ("pose", "z", -1)
    assert position["zero"] == pytest.approx(-200.0, abs=0.1)
    again = bench.hc("setup", "--yes", "-o", "arm.yaml")
    assert (again.returncode, again.stderr.count("\n")) == (2, 1)
    assert "exists already" in again.stderr

    # What was written is taken by the node, and its word and the doctor's agree.
    arguments = ("--ros-args", "--params-file", str(bench.folder / "arm.yaml"))
    bench.start("-m", "hc_estimator.node", *arguments)
    done = bench.patiently("doctor", "--seconds", "6", "--json")
    verdict = json.loads(done.stdout)
    assert verdict["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.15)
    assert verdict["parameters"]["displacement_exponent"] == pytest.approx(1.5, rel=0.1)
    assert not any("input.force.sign" in f["settings"] for f in verdict["findings"])

    # A sign turned by mistake: the doctor says what it costs and what to type, and that helps.
    assert bench.hc("param", "set", "estimator", "input.force.sign", "1").returncode == 0
    done = bench.patiently("doctor", "--seconds", "6", "--json")
    assert done.returncode == 1
    verdict = json.loads(done.stdout)
    faults = [f for f in verdict["findings"] if "input.force.sign" in f["settings"]]
    assert len(faults) == 1, verdict
    fault = faults[0]
    assert fault["settings"]["input.force.sign"] == -1
    assert fault["type"][0] == "hc param set estimator input.force.sign -1"
    assert "K" in fault["cost"]
    # The zero was found with the other sign; what is typed for it puts it right again.
    for finding in verdict["findings"]:
        for command in finding["type"]:
            assert bench.hc(*command.split()[1:]).returncode == 0, command
    zero = float(bench.hc("param", "get", "estimator", "input.force.zero", "--hide-type").stdout)
    assert zero == pytest.approx(-4.2, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "rocking_deg"), [("pose", 24.0), ("tf", 24.0), ("pose", 0.0)])
def test_setup_says_that_the_tool_turned(bench, kind, rocking_deg):
    position = {"type": kind, "topic": "/tf"} if kind == "tf" else {}
    bench.robot(rest_s=0.5, rocking_deg=rocking_deg, position=position)
    done = bench.patiently("setup", "--yes", "--no-run", "--seconds", "6", "-o", "arm")
    assert done.returncode == 0, done.stderr
    said = " ".join(done.stdout.split())
    told = re.search(r"the tool turned by up to (\d+) degrees.*input.contact.frame: surface", said)
    assert bool(told) == (rocking_deg > 0.0), said
    assert not told or 6 <= int(told[1]) <= 48  # to and fro by 24


@pytest.mark.slow
def test_setup_starts_the_run_that_it_wrote_and_the_run_can_be_computed_again(bench):
    bench.robot(**ROBOT)
    words = ("-m", "hc_bringup", "setup", "--yes", "--seconds", "8")
    process = bench.start(*words)

    def bags():
        return sorted((bench.folder / "bags").glob("run_*"))

    end = time.monotonic() + 150.0  # the first start on a machine compiles the filters
    log = bench.folder / "process_1.log"
    while "Hz  lost" not in log.read_text() and time.monotonic() < end:
        assert process.poll() is None, log.read_text()
        time.sleep(0.5)
    time.sleep(6.0)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=40.0) == 0
    assert (bench.folder / "my_robot.yaml").exists()
    assert (bench.folder / "my_robot_run.yaml").exists()
    (bag,) = bags()
    done = bench.hc("estimate", str(bag), "--verify")
    assert done.returncode == 0, done.stdout + done.stderr
    assert "0 different" in done.stdout
    assert "could not be recomputed" not in done.stdout

    # Who estimates the bag anew is as sure as the run was: of the surface, too.
    told = float(re.search(r"K = \S+ +± (\S+)", log.read_text())[1])
    again = json.loads(bench.hc("estimate", str(bag), "--json").stdout)
    deviation = float(f"{again['parameters_std']['stiffness']:.2g}")  # two digits were printed
    assert deviation == pytest.approx(told, rel=0.02)
    assert abs(again["parameters"]["stiffness"] - 0.5) < 3.0 * told


def ended_at(bench, words, pattern, number):
    """Start hc, send it a signal once its log shows something; returns status and log."""
    process = bench.start("-m", "hc_bringup", *words)
    log = bench.folder / f"process_{len(bench.started) - 1}.log"
    while re.search(pattern, log.read_text()) is None:
        assert process.poll() is None, log.read_text()
        time.sleep(0.02)
    process.send_signal(number)
    return process.wait(timeout=60.0), log.read_text()


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "moment", ["looking for sensors", r"\.\.\. recording presses: +\d+ s", "recorded; finding axes"]
)
def test_setup_says_what_it_does_and_ends_when_it_is_asked_to(bench, moment, number):
    """Regression: SIGTERM while it computed was lost, and the run was started all the same."""
    bench.robot(**ROBOT)
    time.sleep(2.0)
    status, log = ended_at(bench, ("setup", "--yes", "--seconds", "6"), moment, number)
    assert status == 128 + number, log
    assert log.endswith("hc setup: ended: nothing was written\n")
    assert "Traceback" not in log
    assert not list(bench.folder.glob("my_robot*"))


@pytest.mark.slow
def test_doctor_payload_and_find_surface_end_when_they_are_asked_to(bench):
    bench.robot(on_request=1, position={"jitter_s": 0.001})
    settings = {"source": "sensors", "force.topic": "ft_sensor/wrench", "position.type": "pose"}
    settings |= {"position.topic": "tool_pose", "position.sign": -1, "position.zero": -200.0}
    words = [w for name, value in settings.items() for w in ("-p", f"input.{name}:={value}")]
    bench.start("-m", "hc_estimator.node", "--ros-args", *words)
    assert bench.patiently("param", "get", "estimator", "input.source").returncode == 0
    for command, moment in (
        (("doctor", "--seconds", "60"), "listening to /estimator: "),
        (("payload", "--yes", "--seconds", "60"), r"\.\.\. recording: "),
        (("find-surface",), r"\.\.\. find_surface: free of contact: "),
    ):
        status, log = ended_at(bench, command, moment, signal.SIGTERM)
        assert status == 128 + signal.SIGTERM, log
        assert "Traceback" not in log
    mass = bench.hc("param", "get", "estimator", "input.payload.mass", "--hide-type").stdout
    assert float(mass) == 0.0  # half of the attitudes are no payload


@pytest.mark.slow
def test_setup_without_a_robot_is_one_line(bench):
    done = bench.hc("setup", "--yes")
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "is the robot's driver running, in this ROS_DOMAIN_ID" in done.stderr
    done = bench.hc("setup")
    assert (done.returncode, done.stderr) == (
        2,
        "hc setup: there is no terminal to ask at: give --yes\n",
    )


def recording(path, change=lambda t, d, f: (t, d, f), delay_s=0.0):
    """A CSV of presses at several speeds into a known tissue."""
    generator = np.random.default_rng(3)
    time_s = np.arange(0.0, 12.0, 0.002)

    def depth(at):
        return 1.5 + 2.2 * np.sin(2.1 * at) + 0.5 * np.sin(13.0 * at)

    late = time_s - delay_s
    speed = np.gradient(depth(late), 0.002)
    pairs = zip(depth(late), speed, strict=True)
    force = np.array(
        [hunt_crossley_force(d, v, 0.5, 0.05, 1.5, 1.0) if d > 0 else 0.0 for d, v in pairs]
    )
    rows = change(
        time_s,
        depth(time_s) + 0.003 * generator.standard_normal(time_s.size),
        force + 0.01 * generator.standard_normal(time_s.size),
    )
    text = "\n".join(",".join(f"{x:.6f}" for x in row) for row in zip(*rows, strict=True))
    path.write_text(f"time_s,displacement_mm,force_N\n{text}\n")
    return str(path)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "settings"),
    [
        (lambda t, d, f: (t, -d, f), {"input.position.sign": -1}),
        (lambda t, d, f: (t, d, 1000.0 * f), {"input.force.scale": 0.001}),
        (lambda t, d, f: (t, d, f + 1.7), {"input.force.zero": pytest.approx(1.7, abs=0.02)}),
        (
            lambda t, d, f: (t, d + 412.0, f),
            {"input.position.zero": pytest.approx(412.0, abs=0.05)},
        ),
    ],
)
def test_doctor_puts_a_recording_right_and_says_what_the_fault_costs(bench, change, settings):
    path = recording(bench.folder / "presses.csv", change)
    done = bench.hc("doctor", path, "--json")
    assert done.returncode == 1, done.stderr
    verdict = json.loads(done.stdout)
    told = [f["settings"] for f in verdict["findings"]]
    surface_std_mm = [put.pop("contact_position_std", None) for put in told]
    faults = [f for f in verdict["findings"] if f["settings"].keys() == settings.keys()]
    assert faults[-1]["settings"] == settings
    known = "input.position.zero" in settings
    assert [std is not None and 0.0 < std < 0.05 for std in surface_std_mm].count(True) == known
    assert all(fault["cost"] for fault in faults)
    assert verdict["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.1)


@pytest.mark.slow
def test_doctor_finds_a_delay_and_forecasts_what_the_motion_does_not_show(bench):
    path = recording(bench.folder / "late.csv", delay_s=0.03)
    verdict = json.loads(bench.hc("doctor", path, "--json").stdout)
    (fault,) = [f for f in verdict["findings"] if "input.force.time_offset" in f["settings"]]
    assert fault["settings"]["input.force.time_offset"] == pytest.approx(-0.03, abs=0.003)
    slow = bench.folder / "slow.csv"
    time_s = np.arange(0.0, 10.0, 0.01)
    depth = 1.0 + 0.1 * time_s
    force = 0.5 * depth**1.5 + 0.02 * np.random.default_rng(1).standard_normal(time_s.size)
    rows = "\n".join(f"{t},{d},{f}" for t, d, f in zip(time_s, depth, force, strict=True))
    slow.write_text(f"time_s,displacement_mm,force_N\n{rows}\n")
    text = bench.hc("doctor", str(slow)).stdout
    assert "to know more: " in text
    assert " mm/s give" in text


def test_the_live_line_fits_the_terminal_and_does_not_stay_on_it(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    shown = Terminal()
    monkeypatch.setattr(sys, "stderr", shown)
    monkeypatch.setenv("COLUMNS", "20")
    tell = LiveLine()
    tell("press:  3 s")
    tell("force changed by 2.34 N, tool moved 3.4 mm")
    tell.clear()
    assert shown.getvalue() == "\r\x1b[Kpress:  3 s\r\x1b[Kforce changed by 2.\r\x1b[K"
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    LiveLine()("press:  3 s")
    assert sys.stderr.getvalue() == ""
