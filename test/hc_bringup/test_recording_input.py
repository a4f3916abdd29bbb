"""Sensors of one's own in a recording: --input with the names of the node's parameters."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_bringup.cli import main
from hc_bringup.errors import UserError
from hc_logger.writer import BagWriter

EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"
START_NS = 1_700_000_000_000_000_000
K, B, N = 0.5, 0.015, 1.5  # of the tissue of `reading` and `press_table` (conftest.py)
FORCE_ZERO, SURFACE_MM = 0.7, 3.0

REAL_SENSORS = (
    "force.topic=/ft/wrench",
    "force.axis=direction",
    "force.direction=[0, -3, 4]",
    "force.sign=-1",
    f"force.zero={FORCE_ZERO}",
    "position.axis=y",
    "position.sign=-1",
    f"position.zero={-SURFACE_MM}",
    "pairing.maximum_gap=0.05",
)


@pytest.fixture(scope="module")
def robot_bag(tmp_path_factory: pytest.TempPathFactory, reading) -> Path:
    """A wrist sensor askew and an arm whose y points out of the tissue, from another robot."""
    generator = np.random.default_rng(5)
    path = tmp_path_factory.mktemp("robot") / "robot"
    with BagWriter(path) as writer:
        force = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        other = writer.add_topic("/other/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/arm/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(3000):
            stamp = START_NS + k * 1_000_000
            depth, true_force = reading(k * 1e-3)
            wrench = WrenchStamped()
            wrench.header.stamp.sec, wrench.header.stamp.nanosec = divmod(stamp, 10**9)
            along = -(true_force + FORCE_ZERO + 0.005 * generator.standard_normal())
            wrench.wrench.force.y, wrench.wrench.force.z = -0.6 * along, 0.8 * along
            writer.write(force, stamp, serialize_message(wrench))
            writer.write(other, stamp, serialize_message(WrenchStamped(header=wrench.header)))
            position = PoseStamped(header=wrench.header)
            noise = 0.002 * generator.standard_normal()
            position.pose.position.y = (SURFACE_MM - depth + noise) * 1e-3
            writer.write(pose, stamp, serialize_message(position))
    return path


def options(*settings: str) -> list[str]:
    return [word for setting in settings for word in ("--input", setting)]


def test_a_bag_of_another_robot_gives_its_tissue(robot_bag: Path, capsys) -> None:
    assert main(["estimate", str(robot_bag), "--json", *options(*REAL_SENSORS)]) == 0
    found = json.loads(capsys.readouterr().out)["parameters"]
    assert found["stiffness"] == pytest.approx(K, rel=0.05)
    assert found["damping"] == pytest.approx(B, rel=0.05)
    assert found["displacement_exponent"] == pytest.approx(N, rel=0.05)


def test_a_direction_needs_no_brackets_and_a_wrong_one_is_told(
    robot_bag: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: "force.direction=0,-3,4 is not a list of numbers"."""
    plain = [s.replace("[0, -3, 4]", "0,-3,4") for s in REAL_SENSORS]
    np.testing.assert_array_equal(
        loaded(robot_bag, *plain).force_n, loaded(robot_bag, *REAL_SENSORS).force_n
    )
    assert main(["estimate", str(robot_bag), *options("force.direction=0,x,4")]) == 2
    assert "is not a list of numbers (0.6,0,0.8)" in capsys.readouterr().err
    along_z = [s for s in plain if "direction" not in s]
    (said,) = loaded(robot_bag, *along_z).findings.problems
    assert "37 degrees off the axis that is read" in said
    assert "--input force.axis=direction --input force.direction=0.000,-0.600,0.800" in said


def test_the_sensors_of_a_bag_are_less_what_the_robot_gave_way(robot_bag: Path) -> None:
    read = loaded(robot_bag, *REAL_SENSORS)
    less = loaded(robot_bag, *REAL_SENSORS, "position.frame_compliance=0.01")
    np.testing.assert_array_equal(less.force_n, read.force_n)
    np.testing.assert_array_equal(less.displacement_mm, read.displacement_mm - 0.01 * read.force_n)


def test_the_zeros_of_a_csv_are_taken_off(tmp_path: Path, capsys, reading) -> None:
    rows = {"true": [], "off": []}
    for k in range(2000):
        depth, force = reading(k * 1e-3)
        rows["true"].append(f"{k * 1e-3!r},{depth!r},{force!r}")
        rows["off"].append(f"{k * 1e-3!r},{depth + 4.0!r},{force - 2.0!r}")
    found = []
    for name, zeros in (("true", ()), ("off", ("position.zero=4", "force.zero=-2.0"))):
        path = tmp_path / f"{name}.csv"
        path.write_text("time_s,displacement_mm,force_N\n" + "\n".join(rows[name]) + "\n")
        assert main(["estimate", str(path), "--json", *options(*zeros)]) == 0
        found.append(json.loads(capsys.readouterr().out)["parameters"])
    for name, value in found[0].items():
        assert found[1][name] == pytest.approx(value, rel=1e-3)


def loaded(path: Path, *settings: str, flags: tuple[str, ...] = ()):
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    return recording_input.load(parser.parse_args([str(path), *flags, *options(*settings)]))


def test_a_table_is_turned_scaled_and_zeroed_as_the_node_does_it(press_table) -> None:
    true = loaded(press_table("true.csv", lambda t, d, f: (t, d, f)))
    path = press_table("raw.csv", lambda t, d, f: (t, -(d + 3.0) / 1e3, 2.0 - f))
    found = loaded(
        path,
        "position.sign=-1",
        "position.scale=1000",
        "position.zero=3",
        "force.sign=-1",
        "force.zero=-2",
    )
    np.testing.assert_allclose(found.displacement_mm, true.displacement_mm, atol=1e-12)
    np.testing.assert_allclose(found.force_n, true.force_n, atol=1e-12)


def test_a_time_offset_of_a_table_puts_every_reading_at_its_own_stamp(press_table, reading) -> None:
    path = press_table("late.csv", lambda t, d, f: (t, d, f))
    found = loaded(path, "force.time_offset=-0.0205")
    there = ~np.isnan(found.force_n)
    assert there.sum() == 2000
    assert np.isnan(found.displacement_mm[there]).all()
    assert found.time_s[there][0] == pytest.approx(-0.0205)
    assert (np.diff(found.time_s) >= 0.0).all()
    np.testing.assert_allclose(np.diff(found.time_s), np.diff(found.stamps) * 1e-9, atol=1e-9)
    assert found.displacement_mm[~there][0] == pytest.approx(reading(0.0)[0])


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ("force.axis=z", "force.axis is for a bag: of a CSV say force.sign, "),
        ("force.sign=2", "force.sign=2 is not 1 or -1"),
        ("force.scale=0", "force.scale=0 is not a number from 1e-09"),
        ("position.scale=-1", "position.scale=-1 is not a number from 1e-09"),
        ("position.time_offset=1e300", "position.time_offset=1e+300 s is not a number up to 1e+09"),
    ],
)
def test_what_a_table_does_not_have_is_refused(press_table, capsys, setting, expected) -> None:
    path = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["estimate", str(path), "--input", setting]) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize("offset", ["force.time_offset=1e9", "position.time_offset=-1.2"])
def test_an_offset_that_moves_the_channels_apart_is_refused(press_table, capsys, offset) -> None:
    """Regression: "the 4000 samples show nothing of K, B, n and p: press, and move"."""
    path = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["estimate", str(path), "--input", offset]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    name, _, value = offset.partition("=")
    assert f"--input: {name}={float(value):g} s leaves " in line
    assert "of the 2 s in which there are displacements and forces" in line
    loaded(path, "force.time_offset=0.9")  # half a recording stays: somebody may mean it


def test_an_offset_that_brings_two_clocks_together_is_no_fault(tmp_path: Path) -> None:
    rows = [f"{k * 1e-3:.3f},{k * 1e-3:.4f},nan" for k in range(1000)]
    rows += [f"{37 + k * 1e-3:.3f},nan,{k * 1e-3:.4f}" for k in range(1000)]
    path = tmp_path / "clocks.csv"
    path.write_text("\n".join(["time_s,displacement_mm,force_N", *rows]) + "\n")
    assert np.ptp(loaded(path, "force.time_offset=-37").time_s) == pytest.approx(0.999)


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (["force.colour=1"], "force.colour is none of force.topic, "),
        (["force.sign=0.5"], "force.sign=0.5 is not a whole number"),
        (["force.sign=2", "force.topic=/ft/wrench"], "sign = 2 is not 1 or -1"),
        (["force.zero=high"], "force.zero=high is not a number"),
        (["force.zero=true"], "force.zero=True is not a number"),
        (["force.direction=3", "force.axis=direction"], "is not a list of numbers"),
        (["force.axis=w", "force.topic=/ft/wrench"], "axis = 'w' is not one of"),
        (["force.topic=/no"], "no force topic /no"),
        (
            ["force.sign=1"],
            "2 force topics (/ft/wrench, /other/wrench); name one: --input force.topic=/ft/wrench",
        ),
        ([], "several sensors, name them: --input force.topic=/ft/wrench, say"),
    ],
)
def test_what_is_wrong_is_one_line(robot_bag: Path, capsys, settings, expected) -> None:
    assert main(["estimate", str(robot_bag), *options(*settings)]) in (1, 2)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert expected in captured.err


def test_the_report_compares_the_channels(robot_bag: Path, tmp_path: Path, capsys) -> None:
    target = tmp_path / "page.html"
    off = [s for s in REAL_SENSORS if not s.startswith("position.zero")]
    wrong = (*off, f"position.zero={-SURFACE_MM - 0.5}")
    assert main(["report", str(robot_bag), "-o", str(target), *options(*wrong)]) == 0
    page = target.read_text(encoding="utf-8")
    row = next(line for line in page.split("<tr>") if "contact position" in line)
    cells = [cell.split("</td>")[0] for cell in row.split("<td>")[1:]]
    assert float(cells[1].split()[0]) == pytest.approx(0.5, abs=0.1)
    assert cells[-1] == "yes"


def test_a_verification_takes_its_input_as_recorded(robot_bag: Path, capsys) -> None:
    words = ["estimate", str(robot_bag), "--verify", *options("force.zero=1")]
    assert main(words) == 2
    assert "leave the others away" in capsys.readouterr().err


@pytest.fixture
def slow_pose_bag(tmp_path: Path, reading) -> Path:
    """A wrench at 500 Hz beside a pose at 125 Hz that comes 20 ms late."""
    generator = np.random.default_rng(6)
    path = tmp_path / "slow"
    events = [(k * 2_000_000, k * 2_000_000, "wrench") for k in range(2000)]
    events += [(k * 8_000_000 + 20_300_000, k * 8_000_000 + 300_000, "pose") for k in range(500)]
    with BagWriter(path) as writer:
        topics = {
            "wrench": writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped"),
            "pose": writer.add_topic("/arm/pose", "geometry_msgs/msg/PoseStamped"),
        }
        for arrival, since, what in sorted(events):
            depth, force = reading(since * 1e-9)
            message = WrenchStamped() if what == "wrench" else PoseStamped()
            stamp = message.header.stamp
            stamp.sec, stamp.nanosec = divmod(START_NS + since, 10**9)
            if what == "wrench":
                message.wrench.force.z = force + 0.005 * generator.standard_normal()
            else:
                message.pose.position.z = (depth + 0.002 * generator.standard_normal()) * 1e-3
            writer.write(topics[what], START_NS + arrival, serialize_message(message))
    return path


def test_readings_at_stamps_of_their_own_go_through_every_command(
    slow_pose_bag: Path, tmp_path: Path, capsys
) -> None:
    source, csv, out = str(slow_pose_bag), str(tmp_path / "slow.csv"), tmp_path / "out.csv"
    assert main(["estimate", source, "--json", "-o", str(out)]) == 0
    captured = capsys.readouterr()
    assert "1999 rows with a force alone, 500 rows with a displacement alone" in captured.err
    found = json.loads(captured.out)
    assert (found["forces"], found["displacements"]) == (1999, 500)
    assert found["used"] == found["samples"] == 2499
    assert found["parameters"]["stiffness"] == pytest.approx(K, rel=0.03)
    assert found["parameters"]["displacement_exponent"] == pytest.approx(N, rel=0.03)
    assert found["model_mismatch_share"] < 0.02
    assert 0.005 < found["force_predicted_rmse_n"] < 0.05
    assert 1.2 < found["nis_mean"] < 2.8
    assert len(out.read_text().splitlines()) == 2500
    assert main(["bag", "convert", source, csv]) == 0
    capsys.readouterr()
    assert main(["estimate", csv, "--json"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again["parameters"] == pytest.approx(found["parameters"], rel=1e-6)
    assert main(["bag", "convert", csv, str(tmp_path / "bag")]) == 0
    assert main(["bag", "info", str(tmp_path / "bag")]) == 0
    assert "displacement 125.0" in (told := capsys.readouterr().out)
    assert "force 499.8" in told
    assert main(["report", source, "-o", str(tmp_path / "page.html")]) == 0
    page = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "The contact law describes what the sensors say" in page
    assert "nan" not in page.split("<script", 1)[0].lower().replace("nance", "")
    assert main(["report", source, "-o", str(tmp_path / "page.png")]) == 0
    assert main(["contacts", source, "-o", str(tmp_path / "contacts.csv")]) == 0
    header, row = (tmp_path / "contacts.csv").read_text().splitlines()[:2]
    contact = dict(zip(header.split(","), row.split(","), strict=True))
    assert float(contact["peak_force [N]"]) == pytest.approx(7.4, abs=0.8)
    assert float(contact["energy_loss [mJ]"]) > 0.0


def test_how_a_csv_is_written_says_nothing_of_a_bag(capsys, tmp_path: Path) -> None:
    """Regression: --rate, --units and so on were taken for a bag, and did nothing."""
    preset = tmp_path / "preset.yaml"
    preset.write_text("separator: tab\n")
    for words, option in (
        (["--rate", "500"], "--rate"),
        (["--units", "force=mN"], "--units"),
        (["--header-lines", "2"], "--header-lines"),
        (["--preset", str(preset)], "--separator"),
    ):
        assert main(["estimate", str(EXAMPLE), *words]) == 2
        error = capsys.readouterr().err
        assert error.count("\n") == 1
        assert f"{option} is for a CSV file" in error
    target = str(tmp_path / "out.csv")
    assert main(["bag", "convert", str(EXAMPLE), target, "--rate", "500"]) == 2
    assert "--rate is for a CSV file" in capsys.readouterr().err
    (tmp_path / "in.csv").write_text("time_s,displacement_mm,force_N\n0,1,2\n")
    words = ["bag", "convert", str(tmp_path / "in.csv"), str(tmp_path / "bag"), "--topic", "x"]
    assert main(words) == 2
    assert "--topic is for a bag" in capsys.readouterr().err


def test_a_channel_of_a_table_that_is_repeated_counts_once(press_table, tmp_path) -> None:
    stepped = {"last": (0.0, 0.0)}

    def hold(t, d, f):
        if round(t * 1e3) % 4 == 0:
            stepped["last"] = (d, f)
        return t, stepped["last"][0], f

    found = loaded(press_table("held.csv", hold), "position.held=true")
    there = ~np.isnan(found.displacement_mm)
    assert not np.isnan(found.force_n).any()
    assert np.flatnonzero(there).tolist() == list(range(0, 2000, 4))
    with pytest.raises(UserError, match=r"position\.held=1 is not true or false"):
        loaded(tmp_path / "held.csv", "position.held=1")


def test_the_samples_of_a_bag_are_stamped_and_not_its_sensors_read(tmp_path: Path, reading) -> None:
    """Regression: what `hc doctor` said of a bag of `hc run` read its sensors with other axes."""
    from hc_msgs.msg import IndenterSample

    path = tmp_path / "run"
    with BagWriter(path) as writer:
        sample = writer.add_topic("/indenter/sample", "hc_msgs/msg/IndenterSample")
        wrench = writer.add_topic("/ft/wrench", "geometry_msgs/msg/WrenchStamped")
        pose = writer.add_topic("/arm/pose", "geometry_msgs/msg/PoseStamped")
        for k in range(1000):
            stamp = START_NS + k * 1_000_000
            depth, force = reading(k * 1e-3)
            made = IndenterSample(sequence=k, displacement=depth * 1e-3, force=force)
            made.header.stamp.sec, made.header.stamp.nanosec = divmod(stamp, 10**9)
            writer.write(sample, stamp, serialize_message(made))
            raw = WrenchStamped(header=made.header)
            raw.wrench.force.z = -force
            writer.write(wrench, stamp, serialize_message(raw))
            writer.write(pose, stamp, serialize_message(PoseStamped(header=made.header)))
    plain = loaded(path)
    late = loaded(path, "position.time_offset=-0.0065", "force.scale=2")
    there = ~np.isnan(late.force_n)
    np.testing.assert_array_equal(late.force_n[there], 2.0 * plain.force_n)
    np.testing.assert_array_equal(late.displacement_mm[~there], plain.displacement_mm)
    np.testing.assert_array_equal(late.stamps[~there], plain.stamps - 6_500_000)
    sensors = loaded(path, "force.topic=/ft/wrench")
    np.testing.assert_allclose(sensors.force_n, -plain.force_n)
    with pytest.raises(UserError, match=r"force\.sign=3 is not 1 or -1"):
        loaded(path, "force.sign=3")
