"""Sensors of one's own in a recording: --input with the names of the node's parameters."""

import argparse
import dataclasses
import json
import math
import shlex
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_bringup.cli import command_parser, main
from hc_bringup.commands.estimate import make_estimator
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.readings import MEANINGS
from hc_logger.recording import read_recording
from hc_logger.writer import BagWriter

EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example"
START_NS = 1_700_000_000_000_000_000
K, B, N = 0.5, 0.015, 1.5  # with which the tissue never pulls
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


def reading(time_s: float) -> tuple[float, float]:
    """Return the true displacement [mm] and force [N]."""
    depth = 3.0 + 1.5 * math.sin(9.0 * time_s) + 0.5 * math.sin(31.0 * time_s)
    speed = 13.5 * math.cos(9.0 * time_s) + 15.5 * math.cos(31.0 * time_s)
    return depth, depth**N * (K + B * speed)


@pytest.fixture
def robot_bag(tmp_path: Path) -> Path:
    """A wrist sensor askew and an arm whose y points out of the tissue, from another robot."""
    generator = np.random.default_rng(5)
    path = tmp_path / "robot"
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


def test_the_zeros_of_a_csv_are_taken_off(tmp_path: Path, capsys) -> None:
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


def write_table(path: Path, change) -> Path:
    """Two seconds of presses; `change` turns time, depth and force into what stands in the file."""
    true = [(k * 1e-3, *reading(k * 1e-3)) for k in range(2000)]
    rows = "".join(",".join(map(repr, change(*row))) + "\n" for row in true)
    path.write_text(f"time_s,displacement_mm,force_N\n{rows}")
    return path


def loaded(path: Path, *settings: str):
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    return recording_input.load(parser.parse_args([str(path), *options(*settings)]))


def test_a_table_is_turned_scaled_and_zeroed_as_the_node_does_it(tmp_path: Path) -> None:
    true = loaded(write_table(tmp_path / "true.csv", lambda t, d, f: (t, d, f)))
    path = write_table(tmp_path / "raw.csv", lambda t, d, f: (t, -(d + 3.0) / 1e3, 2.0 - f))
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


def test_a_time_offset_of_a_table_puts_every_reading_at_its_own_stamp(tmp_path: Path) -> None:
    path = write_table(tmp_path / "late.csv", lambda t, d, f: (t, d, f))
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
    ],
)
def test_what_a_table_does_not_have_is_refused(tmp_path: Path, capsys, setting, expected) -> None:
    path = write_table(tmp_path / "table.csv", lambda t, d, f: (t, d, f))
    assert main(["estimate", str(path), "--input", setting]) == 2
    assert expected in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "what", "status"),
    [
        (lambda t, d, f: (t, d - 2.0, -f), "sign", 1),
        (lambda t, d, f: (t, d / 1e3, f), "unit", 1),
        (lambda t, d, f: (t, d + 60.0, f), "far from zero", 0),
    ],
)
def test_parameters_that_are_not_the_tissues_end_with_status_1(
    tmp_path: Path, capsys, change, what, status
) -> None:
    path = write_table(tmp_path / "table.csv", change)
    out = tmp_path / "estimates.csv"
    assert main(["estimate", str(path), "--json", "-o", str(out)]) == status
    told = capsys.readouterr()
    assert len(json.loads(told.out)["suspicions"]) == 1, told.err
    last = told.err.splitlines()[-1] if status else told.err
    assert what in last
    assert f"what each means and what to do: {MEANINGS}" in told.err
    assert ("not the parameters of the tissue" in told.err) is (status == 1)
    assert out.exists()


def test_a_recording_of_which_next_to_nothing_can_be_used_gives_no_parameters(
    tmp_path: Path, capsys
) -> None:
    """Regression: rows from last to first gave K = 0.88 and status 0, of one sample."""
    path = write_table(tmp_path / "backward.csv", lambda t, d, f: (-t, d, f))
    assert main(["estimate", str(path)]) == 1
    told = capsys.readouterr()
    assert "K = " not in told.out
    assert "mostly go backward: sort the readings by time" in told.err
    last = told.err.splitlines()[-1]
    assert "1 of the " in last
    assert "time_backward" in last


def test_a_short_press_with_a_small_force_is_told_as_what_it_is(tmp_path: Path, capsys) -> None:
    path = tmp_path / "short.csv"
    rows = "".join(f"{1e-3 * k},{2e-3 * k:.4f},{2e-5 * k:.7f}\n" for k in range(300))
    path.write_text(f"Time [s],Position [mm],Force [N]\n{rows}")
    assert main(["estimate", str(path)]) == 0
    told = capsys.readouterr()
    assert "after the first 0.15 s of contact: force error " in told.out
    assert " 0.0 mN" not in told.out
    assert "read as: the tool moves by 0.592 mm and pushes with up to 0.00595 N" in told.err


def test_doctor_says_that_a_few_rows_are_too_few(tmp_path: Path, capsys) -> None:
    """Regression: "nothing is wrong" of two rows, with forecasts."""
    path = tmp_path / "two.csv"
    path.write_text("time_s,displacement_mm,force_N\n0,1,2\n0.1,1,2\n")
    assert main(["doctor", str(path)]) == 1
    assert "2 readings of the displacement are too few to judge" in capsys.readouterr().out


def test_what_doctor_says_to_type_puts_a_table_right(tmp_path: Path, capsys) -> None:
    path = write_table(tmp_path / "pull.csv", lambda t, d, f: (t, d - 2.0, -f))
    assert main(["doctor", str(path), "--json"]) == 1
    (command,) = json.loads(capsys.readouterr().out)["findings"][0]["type"]
    assert command == f"hc estimate {path} --input force.sign=-1"
    assert main([*command.split()[1:], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["suspicions"] == []


def test_how_a_recording_was_read_is_no_finding_of_the_doctor(tmp_path: Path, capsys) -> None:
    path = tmp_path / "named.csv"
    rows = "".join(f"{k},{reading(k * 1e-3)[0]!r},{reading(k * 1e-3)[1]!r}\n" for k in range(2000))
    path.write_text(f"Time [ms];Weg [mm];Kraft [N]\n{rows}".replace(",", ";"))
    main(["doctor", str(path), "--json"])
    verdict = json.loads(capsys.readouterr().out)
    assert "time is 'Time [ms]' in ms" in verdict["notes"][0]
    assert not any("Time [ms]" in finding["what"] for finding in verdict["findings"])


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
        (["force.sign=1"], "2 force topics (/ft/wrench, /other/wrench); name one"),
        ([], "name them (force.topic, position.topic)"),
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


def test_the_surface_of_a_recording_is_found(tmp_path: Path, capsys) -> None:
    generator = np.random.default_rng(9)
    time = np.arange(4000) * 1e-3
    later = np.maximum(time - 1.4, 0.0)
    depth = np.minimum(8.0 * time - 8.0, 3.2) + 1.5 * np.sin(9.0 * later) + 0.5 * np.sin(31 * later)
    speed = np.gradient(depth, time)
    force = np.maximum(depth, 0.0) ** N * (K + B * speed)
    columns = (
        time,
        depth + 5.0 + 0.002 * generator.standard_normal(4000),
        force - 1.0 + 0.01 * generator.standard_normal(4000),
    )
    rows = [",".join(map(repr, row)) for row in np.column_stack(columns).tolist()]
    path = tmp_path / "raw.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + "\n".join(rows) + "\n")
    assert main(["estimate", str(path), "--find-surface", "--json"]) == 0
    captured = capsys.readouterr()
    assert "surface found at 5" in captured.err or "surface found at 4.9" in captured.err
    assert "force zero -1" in captured.err or "force zero -0.99" in captured.err
    found = json.loads(captured.out)
    assert found["parameters"]["displacement_exponent"] == pytest.approx(N, rel=0.1)

    # How well the surface is known belongs to how well the tissue is.
    words = ["estimate", str(path), "--find-surface", "--json"]
    assert main([*words, "--param", "contact_position_std=0"]) == 0
    exact = json.loads(capsys.readouterr().out)
    assert exact["parameters"] == found["parameters"]
    assert exact["parameters_std"]["stiffness"] < 0.9 * found["parameters_std"]["stiffness"]


def test_a_recording_without_an_approach_says_so(tmp_path: Path, capsys) -> None:
    path = tmp_path / "pressed.csv"
    rows = "\n".join(f"{k * 1e-3!r},1.0,2.0" for k in range(500))
    path.write_text("time_s,displacement_mm,force_N\n" + rows + "\n")
    assert main(["estimate", str(path), "--find-surface"]) == 1
    assert "does not go from free motion into contact" in capsys.readouterr().err


@pytest.fixture
def slow_pose_bag(tmp_path: Path) -> Path:
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


def test_a_recording_without_forces_says_so(tmp_path: Path, capsys) -> None:
    path = tmp_path / "alone.csv"
    rows = "\n".join(f"{k * 1e-3!r},{k * 1e-3!r},nan" for k in range(500))
    path.write_text("time_s,displacement_mm,force_N\n" + rows + "\n")
    assert main(["estimate", str(path)]) == 1
    assert "there is no force in any of the 500 samples" in capsys.readouterr().err


def test_what_the_doctor_says_to_type_mends_all_that_was_found_at_once(
    tmp_path: Path, capsys
) -> None:
    """Regression: two signs were two commands, and each alone left the recording wrong."""
    time_s = np.arange(0.0, 12.0, 0.005)
    depth = 1.2 + 2.2 * np.sin(2.1 * time_s - 1.2) + 0.4 * np.sin(13.0 * time_s)
    speed = np.gradient(depth, time_s)
    force = [
        hunt_crossley_force(d, v, 0.5, 0.05, 1.5, 1.0) for d, v in zip(depth, speed, strict=True)
    ]
    rows = zip(time_s, -depth - 7.0, -np.array(force), strict=True)
    path = tmp_path / "pull test.csv"
    path.write_text("t;way;load\n" + "".join(f"{t:.4f};{d:.6f};{f:.6f}\n" for t, d, f in rows))
    said = ("--columns", "time=t,displacement=way,force=load")
    said += ("--units", "time=s,displacement=mm,force=N")
    assert main(["doctor", str(path), *said, "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    command = shlex.split([c for finding in findings for c in finding["type"]][-1])
    assert main([*command[1:], "--json"]) == 0
    parameters = json.loads(capsys.readouterr().out)["parameters"]
    assert parameters["stiffness"] == pytest.approx(0.5, rel=0.05)
    assert parameters["displacement_exponent"] == pytest.approx(1.5, rel=0.05)


def test_a_bag_is_estimated_with_the_doubt_of_the_surface_that_its_estimator_was_told() -> None:
    """Regression: the bag of a robot's run gave K with a deviation 25 times too small."""
    recording = read_recording(EXAMPLE)
    assert recording.surface_std_mm == 0.0
    (first, *_) = recording.configurations
    told = first._replace(parameters=first.parameters | {"contact_position_std": 0.017})
    doubtful = dataclasses.replace(recording)
    doubtful.__dict__["configurations"] = [first, told]
    assert doubtful.surface_std_mm == 0.017
    arguments = command_parser("estimate").parse_args([str(EXAMPLE)])
    assert make_estimator(arguments, doubtful).configuration["contact_position_std"] == 0.017
    found = dataclasses.replace(doubtful, contact_position_std_mm=0.004)  # looked for in the bag
    found.__dict__["configurations"] = [told]
    assert found.surface_std_mm == 0.004
