"""hc node, topic and param against a real node: as ros2cli, and in plain words."""

import re
import signal
import sys
import time
from pathlib import Path

import pytest
import yaml

from hc_msgs_py.node_processes import end

pytestmark = [pytest.mark.process, pytest.mark.timeout(120)]


class Patient:
    """Runs hc until it finds what it is asked about.

    A command answers within 3 s and says so when it has found nothing by then, which on a machine
    that is busy with other tests happens now and then.
    """

    def __init__(self, command_line) -> None:
        self._command_line = command_line

    def run(self, *words: str, patience_s: float = 30.0):
        deadline = time.monotonic() + patience_s
        while True:
            done = self._command_line.run(*words)
            unseen = any(
                words in done.stderr
                for words in ("there is no node", "nobody publishes", "there is no service")
            )
            if not unseen or time.monotonic() > deadline:
                return done

    def run_until(self, expected: str, *words: str) -> str:
        deadline = time.monotonic() + 60.0
        while expected not in (out := self.run(*words).stdout):
            assert time.monotonic() < deadline, out
        return out


@pytest.fixture
def rig(command_line):
    """A running indenter node at 1 kHz."""
    process = command_line.start(module="hc_sim_rig.node")
    patient = Patient(command_line)
    patient.run_until("/indenter\n", "node", "list")
    assert process.poll() is None, process.stderr.read()
    return patient


def _without_others(line: str) -> str:
    """Return what is said without the runs that somebody else has on this machine."""
    return re.sub(r"; this is ROS domain .*: ROS_DOMAIN_ID=\d+ hc \.\.\.$", "", line, flags=re.M)


@pytest.mark.slow
def test_nothing_runs(command_line) -> None:
    assert command_line.run("node", "list").stdout == "no node is running\n"
    done = command_line.run("topic", "echo", "/indenter/sample", "--once")
    assert done.returncode == 1
    said = "hc topic: nobody publishes /indenter/sample; topics: /parameter_events"
    assert _without_others(done.stderr) == f"{said}\n"
    done = command_line.run("param", "get", "estimator", "x")
    assert done.returncode == 1
    said = "hc param: there is no node /estimator; running nodes: none"
    assert _without_others(done.stderr) == f"{said}\n"


@pytest.mark.slow
def test_commands_on_a_running_node(rig) -> None:
    # one node for all of these: starting it is what costs time
    assert rig.run_until("/indenter\n", "node", "list") == "/indenter\n"
    assert rig.run_until("1\n", "node", "list", "--count-nodes") == "1\n"

    topics = rig.run_until("/indenter/sample [hc_msgs/msg/IndenterSample]\n", "topic", "list", "-t")
    assert "/indenter/truth [hc_msgs/msg/IndenterTruth]\n" in topics

    for name in ("indenter/sample", "/indenter/sample"):
        message = yaml.safe_load(rig.run("topic", "echo", name, "--once").stdout.split("---")[0])
        assert message["header"]["frame_id"] == "indenter_tip"
        assert message["sequence"] >= 0
    value = rig.run("topic", "echo", "indenter/sample", "--once", "--field", "header.stamp.sec")
    assert int(value.stdout.split()[0]) > 1_700_000_000
    csv = rig.run("topic", "echo", "indenter/sample", "--once", "--csv").stdout
    assert len(csv.split(",")) == 6
    wrong = rig.run("topic", "echo", "indenter/sample", "--once", "--field", "nix")
    assert wrong.returncode == 2
    assert "no field 'nix'" in wrong.stderr
    assert "Traceback" not in wrong.stderr

    rate = rig.run("topic", "hz", "indenter/sample", "--timeout", "2").stdout
    measured = float(rate.splitlines()[-2].removeprefix("average rate: "))
    assert measured == pytest.approx(1000.0, rel=0.1)


@pytest.mark.slow
def test_parameters_of_a_running_node(rig, tmp_path) -> None:
    assert "  speed\n" in rig.run("param", "list", "indenter").stdout
    assert (
        "  speed (type: double)\n" in rig.run("param", "list", "/indenter", "--param-type").stdout
    )
    assert rig.run("param", "get", "indenter", "speed").stdout == "Double value is: 1.0\n"
    assert rig.run("param", "get", "indenter", "speed", "--hide-type").stdout == "1.0\n"

    done = rig.run("param", "set", "indenter", "speed", "2")  # a whole number does for a double
    assert (done.returncode, done.stdout) == (0, "Set parameter successful\n")
    assert rig.run("param", "get", "indenter", "speed", "--hide-type").stdout == "2.0\n"

    for words, expected in (
        (("speed", "-1"), "speed"),
        (("speed", "fast"), "speed"),
        (("seed", "3"), "read-only"),
        (("nix", "3"), "no parameter nix"),
    ):
        done = rig.run("param", "set", "indenter", *words)
        assert done.returncode == 1
        assert expected in done.stderr
        assert done.stderr.count("\n") == 1

    dump = rig.run("param", "dump", "indenter").stdout
    assert yaml.safe_load(dump)["/indenter"]["ros__parameters"]["speed"] == 2.0
    file = tmp_path / "indenter.yaml"
    file.write_text(dump)
    rig.run("param", "set", "indenter", "speed", "0.5")
    loaded = rig.run("param", "load", "indenter", str(file))
    assert loaded.stdout.startswith("1 of "), loaded.stderr
    assert rig.run("param", "dump", "indenter").stdout == dump

    file.write_text("indenter: {ros__parameters: {speed: 3.0, amplitude: -5.0}}")
    refused = rig.run("param", "load", "indenter", str(file))
    assert refused.returncode == 1
    assert rig.run("param", "get", "indenter", "speed", "--hide-type").stdout == "2.0\n"  # none


@pytest.fixture
def estimator(command_line, tmp_path):
    """A running estimator with samples of a tool at rest at 0.25 mm and 0.5 N, then a press."""
    file = tmp_path / "estimator.yaml"
    file.write_text(
        f"estimator: {{ros__parameters: {{filter: ukf, tare: {{samples: 50}}, "
        f"state: {{folder: {tmp_path / 'state'}}}}}}}"
    )
    arguments = ("--ros-args", "--params-file", str(file))
    process = command_line.start(*arguments, module="hc_estimator.node")
    patient = Patient(command_line)
    patient.run_until("/estimator\n", "node", "list")
    assert process.poll() is None, process.stderr.read()
    return patient


@pytest.mark.slow
def test_a_parameter_that_is_a_word_or_a_number(estimator, tmp_path) -> None:
    def value(*words: str) -> str:
        return estimator.run("param", "get", "estimator", "channel_delay", *words).stdout

    assert value() == "String value is: auto\n"
    automatic = estimator.run("param", "dump", "estimator").stdout
    for given, expected in (("0.02", "0.02"), ("0", "0.0"), ("auto", "auto"), ("-0.01", "-0.01")):
        done = estimator.run("param", "set", "estimator", "channel_delay", given)
        assert done.returncode == 0, done.stderr
        assert value("--hide-type") == f"{expected}\n"
    assert value() == "Double value is: -0.01\n"
    number = estimator.run("param", "dump", "estimator").stdout
    for given in ("0.5", "soon", "true", "[0.01]"):
        done = estimator.run("param", "set", "estimator", "channel_delay", given)
        assert done.returncode == 1, given
        assert "is not 'auto' or a number from -0.06 to 0.06 s" in done.stderr
    for dumped, expected in ((automatic, "auto"), (number, "-0.01")):
        file = tmp_path / "dump.yaml"
        file.write_text(dumped)
        assert estimator.run("param", "load", "estimator", str(file)).returncode == 0
        assert value("--hide-type") == f"{expected}\n"


@pytest.mark.slow
def test_services_of_a_running_node(rig) -> None:
    rig.run_until("/indenter/run [std_srvs/srv/SetBool]\n", "service", "list", "-t")
    assert rig.run("service", "type", "indenter/run").stdout == "std_srvs/srv/SetBool\n"
    for words in ((), ("std_srvs/srv/SetBool",)):
        done = rig.run("service", "call", "/indenter/run", *words, "{data: false}")
        assert done.returncode == 0, done.stderr
        assert yaml.safe_load(done.stdout)["success"] is True
    done = rig.run("service", "call", "indenter/ready")
    assert yaml.safe_load(done.stdout)["success"] == (done.returncode == 0)
    for words, status, expected in (
        (("indenter/run", "{date: true}"), 2, "there is no field date; fields there: data"),
        (("indenter/run", "{data: 3}"), 2, "data: 3 is no boolean"),
        (("indenter/run", "[1]"), 2, "no fields with values"),
        (("indenter/run", "std_srvs/srv/Trigger", "{}"), 2, "is a std_srvs/srv/SetBool"),
        (("indenter/fly",), 1, "there is no service /indenter/fly"),
    ):
        done = rig.run("service", "call", *words, patience_s=0.0 if status == 1 else 30.0)
        assert (done.returncode, done.stderr.count("\n")) == (status, 1), done.stderr
        assert expected in done.stderr


@pytest.mark.slow
def test_the_estimators_services_in_plain_words(estimator, command_line) -> None:
    done = estimator.run("save")
    while "starting: " in done.stderr:  # the test's timeout ends it
        done = estimator.run("save")
    assert (done.returncode, done.stderr) == (1, "hc save: nothing to save: no sample came yet\n")
    done = estimator.run("tare", "--timeout", "1")
    assert done.returncode == 1
    assert "no zeros were found within 1 s" in done.stderr

    script = Path(__file__).parents[1] / "hc_estimator_node" / "stream_source.py"
    source = command_line.launch([sys.executable, script, "0", "rest"])
    try:
        done = estimator.run("tare")
        lines = done.stdout.splitlines()
        # That of before is still looking, unless it has found its samples by now.
        begun = ("takes the mean of the next 50 samples", "a tare is under way already")
        assert lines[0].startswith(begun), done.stderr
        zeros = re.match(r"force zero (\S+) N .*, contact at (\S+) mm", lines[1])
        assert [float(zero) for zero in zeros.groups()] == pytest.approx([0.5, 0.25], abs=0.01)
        assert estimator.run("reset").stdout == "started afresh\n"
        time.sleep(0.5)
        assert estimator.run("save").stdout.startswith("saved to ")
        assert estimator.run("load").stdout.startswith("goes on from a state saved ")
        source.send_signal(signal.SIGUSR1)  # it moves from now on
        done = estimator.run("tare")
        assert done.returncode == 1
        moved_or_pressed = r"hc tare: (refused: the tool moved by|the tool presses with) "
        assert re.match(moved_or_pressed, done.stderr), done.stderr
        done = estimator.run("tare", "--force")
        assert done.returncode == 0, done.stderr
        assert estimator.run("param", "get", "estimator", "tare.force").stdout.endswith("False\n")
    finally:
        end(source, signal.SIGTERM)
    done = estimator.run("find-surface", "--node", "nobody")
    assert done.returncode == 1
    assert "there is no node /nobody" in done.stderr


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_the_other_words_of_ros2cli_on_a_running_node(rig, command_line) -> None:
    told = rig.run_until("Publisher count: 1\n", "topic", "info", "indenter/sample", "-v")
    assert told.startswith("Type: hc_msgs/msg/IndenterSample\n")
    assert "/indenter: RELIABLE, VOLATILE" in told
    assert "there is no topic /nix" in rig.run("topic", "info", "nix").stderr
    measured = rig.run("topic", "bw", "indenter/sample", "--timeout", "3").stdout.splitlines()[-1]
    assert float(measured.split()[0]) == pytest.approx(60_000.0, rel=0.3)

    shown = rig.run_until(
        "/indenter/sample: hc_msgs/msg/IndenterSample", "node", "info", "indenter"
    )
    assert shown.startswith("/indenter\n")
    assert shown.index("  Publishers:\n") < shown.index("    /indenter/sample:")
    assert "  Service Servers:\n" in shown

    speed = rig.run("param", "describe", "indenter", "spee*").stdout
    assert "Parameter name: speed\n  Type: double\n  Description: " in speed
    assert "    Min value: " in speed
    wrong = rig.run("param", "describe", "indenter", "sped")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (1, 1)
    assert "did you mean speed" in wrong.stderr
    assert "is no managed node" in rig.run("lifecycle", "get", "indenter").stderr

    done = rig.run("topic", "pub", "/x", "std_msgs/msg/Float64", "{data: 2}", "-t", "2", "-w", "0")
    assert done.stdout.splitlines()[-1] == "published 2: {data: 2.0}"
    wrong = rig.run("topic", "pub", "/x", "std_msgs/msg/Float64", "{dta: 2}", "--once")
    assert (wrong.returncode, "no field dta" in wrong.stderr) == (2, True)

    recorder = command_line.start("record", "/indenter/sam*", "-o", "recorded")
    assert "recording into" in recorder.stdout.readline()
    time.sleep(12.0)
    recorder.send_signal(signal.SIGINT)
    assert recorder.wait(20) == 0
    info = rig.run("bag", "info", "recorded").stdout
    row = next(line for line in info.splitlines() if line.startswith("/indenter/sample"))
    assert int(row.split()[2]) > 1000
    assert "/indenter/truth" not in info
    assert command_line.run("record", "x", "-a").returncode == 2


@pytest.mark.slow
@pytest.mark.timeout(400)
def test_the_lifecycle_of_the_estimator(command_line) -> None:
    command_line.start(module="hc_estimator.node")
    patient = Patient(command_line)
    patient.run_until("active [3]\n", "lifecycle", "get", "estimator")
    assert "- deactivate [4]: active" in patient.run("lifecycle", "list", "estimator").stdout
    wrong = patient.run("lifecycle", "set", "estimator", "deactivat")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert "is active and cannot deactivat; did you mean deactivate?" in wrong.stderr
    wrong = patient.run("lifecycle", "set", "estimator", "activate")
    assert (wrong.returncode, wrong.stderr.count("\n")) == (2, 1)
    assert "is active and cannot activate; possible: deactivate, shutdown" in wrong.stderr
    for transition, state in (("deactivate", "inactive [2]\n"), ("activate", "active [3]\n")):
        done = patient.run("lifecycle", "set", "estimator", transition)
        assert (done.returncode, done.stdout) == (0, "Transitioning successful\n"), done.stderr
        assert patient.run("lifecycle", "get", "estimator").stdout == state
