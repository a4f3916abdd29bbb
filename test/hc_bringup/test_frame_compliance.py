"""What a robot gives way, in a recording: taken off as a plain subtraction would, and found."""

import argparse
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hc_msgs.msg import EstimatorConfiguration, IndenterSample
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_bringup.cli import main
from hc_bringup.errors import UserError
from hc_estimator.stream.frame_compliance import TAKEN_OFF_ALREADY
from hc_logger.writer import BagWriter
from hc_msgs_py.units import set_stamp

NAME = "position.frame_compliance"
MM_PER_N = 0.02


def loaded(path, *settings, flags=()):
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    words = [word for setting in settings for word in ("--input", setting)]
    return recording_input.load(parser.parse_args([str(path), *words, *flags]))


def test_the_estimates_are_those_of_a_file_with_a_plain_subtraction(press_table, capsys):
    true = press_table("true.csv", lambda t, d, f: (t, (d + MM_PER_N * f) - MM_PER_N * f, f))
    soft = press_table("soft.csv", lambda t, d, f: (t, d + MM_PER_N * f, f))
    found = []
    for words in ([true], [soft, "--input", f"{NAME}={MM_PER_N}"], [soft]):
        assert main(["estimate", *map(str, words), "--filter", "ukf", "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out)["parameters"])
    assert found[0] == found[1]
    assert found[2]["stiffness"] < 0.99 * found[0]["stiffness"]


def test_many_recordings_are_read_so_too(press_table, tmp_path, capsys):
    soft = press_table("soft.csv", lambda t, d, f: (t, d + MM_PER_N * f, f))
    settings = ["--filter", "ukf", "--input", f"{NAME}={MM_PER_N}"]
    assert main(["estimate", str(soft), *settings, "--json"]) == 0
    alone = json.loads(capsys.readouterr().out)["parameters"]["stiffness"]
    assert main(["batch", str(soft), "-o", str(tmp_path / "out"), "-j", "1", *settings]) == 0
    header, row = (tmp_path / "out" / "recordings.csv").read_text().splitlines()[-2:]
    of_batch = dict(zip(header.split(","), row.split(","), strict=True))
    assert float(of_batch["stiffness [N/mm^n]"]) == alone


def test_the_force_counts_from_its_zero_and_in_its_sign(press_table):
    table = press_table("table.csv", lambda t, d, f: (t, d + 4.0, -f - 2.0))
    read = loaded(table, "force.sign=-1", "force.zero=2.0", "position.zero=4.0")
    less = loaded(table, "force.sign=-1", "force.zero=2.0", "position.zero=4.0", f"{NAME}=0.02")
    np.testing.assert_array_equal(less.force_n, read.force_n)
    np.testing.assert_array_equal(less.displacement_mm, read.displacement_mm - 0.02 * read.force_n)


def test_a_place_without_a_force_has_the_last_one(press_table):
    kept = iter(range(10**6))
    table = press_table(
        "rates.csv", lambda t, d, f: (t, d, f if (k := next(kept)) % 3 == 1 and k < 1000 else "")
    )
    table.write_text(table.read_text().replace("''", ""))
    read, less = loaded(table), loaded(table, f"{NAME}={MM_PER_N}")
    last = np.maximum.accumulate(np.where(np.isnan(read.force_n), 0, np.arange(2000)))
    expected = read.displacement_mm - MM_PER_N * read.force_n[last]
    expected[0] = math.nan  # none has come
    expected[np.arange(2000) > 997 + 500] = math.nan  # for half a second
    np.testing.assert_array_equal(less.displacement_mm, expected)
    np.testing.assert_array_equal(less.force_n, read.force_n)
    gone = np.count_nonzero(np.isnan(expected))
    assert any(
        note.startswith(f"{gone} displacements left out: no force") for note in less.findings.notes
    )


@pytest.mark.parametrize("from_base_mm", [4.0, -499.97134])
def test_zeros_that_are_found_are_those_to_set(tmp_path, from_base_mm):
    """With a force zero off, the surface was said to be where it is not.

    Far from the base it was rounded by more than its deviation: -500 for -499.971.
    """
    random = np.random.default_rng(2)
    time_s = np.arange(2000) * 0.005
    depth = -3.0 * np.cos(0.4 * np.pi * time_s)
    force = 0.5 * np.maximum(depth, 0.0) ** 1.5 + 0.002 * random.standard_normal(2000)
    path = tmp_path / "approach.csv"
    rows = np.column_stack([time_s, depth + from_base_mm + MM_PER_N * force, force + 30.0])
    np.savetxt(path, rows, delimiter=",", header="time_s,displacement_mm,force_N", comments="")
    found = loaded(path, f"{NAME}={MM_PER_N}", flags=("--find-surface",))
    note = next(n for n in found.findings.notes if n.startswith("surface found at"))
    words = note.split()
    position, force_zero = words[3], words[words.index("zero") + 1]
    assert float(position) == pytest.approx(from_base_mm, abs=0.05)
    zeros = (f"position.zero={position}", f"force.zero={force_zero}")
    again = loaded(path, f"{NAME}={MM_PER_N}", *zeros)
    np.testing.assert_allclose(again.displacement_mm, found.displacement_mm, atol=2e-3)
    np.testing.assert_allclose(found.displacement_mm, depth, atol=0.05)


@pytest.mark.parametrize(
    ("value", "says"),
    [
        ("-0.1", "is not a number from 0 to 1000 mm/N"),
        (".nan", "is not a number"),
        ("nan", "is not a number"),
        ("1e9", "is not a number from 0 to 1000 mm/N"),
        ("soft", "is not a number"),
        ("5", "mm only: is it in mm/N"),
    ],
)
def test_what_cannot_be_a_compliance_is_one_line(press_table, capsys, value, says):
    table = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["estimate", str(table), "--input", f"{NAME}={value}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert NAME in error
    assert says in error


def steel(tmp_path, *, mm_per_n=0.004, soft_mm=0.0, name="steel.csv"):
    """Three presses of 20 N on a block of steel, at 100 Hz, each from the air."""
    random = np.random.default_rng(4)
    time_s = np.arange(1200) * 0.01
    force = 20.0 * np.maximum(-np.cos(0.5 * np.pi * time_s), 0.0)
    air = 2.0 * np.minimum(-np.cos(0.5 * np.pi * time_s), 0.0)
    depth = 3.0 + air + mm_per_n * force + soft_mm * (force / 20.0) ** 0.6
    rows = np.column_stack([time_s, depth, force + 0.3])
    rows[:, 1:] += random.standard_normal((1200, 2)) * (0.001, 0.02)
    path = tmp_path / name
    np.savetxt(path, rows, delimiter=",", header="time_s,displacement_mm,force_N", comments="")
    return path


def test_a_press_on_steel_says_what_gives_way_and_what_to_type(tmp_path, capsys):
    path = steel(tmp_path)
    assert main(["compliance", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert abs(found["mm_per_n"] - 0.004) < 4.0 * found["mm_per_n_std"] < 2e-4
    assert (found["ways_in"], found["ways_out"]) == (3, 3)
    assert main(["compliance", str(path)]) == 0
    text = capsys.readouterr().out
    value = f"{found['mm_per_n']:.4g}"
    for line in (
        f"hc param set estimator input.{NAME} {value}",
        f"--input {NAME}={value}",
        f"frame_compliance: {value}",
    ):
        assert line in text
    less = loaded(path, f"{NAME}={value}")
    touching = less.force_n > 3.0
    assert np.std(less.displacement_mm[touching]) < 0.0015  # noise: nothing moves in steel


def test_a_press_on_something_soft_is_refused(tmp_path, capsys):
    assert main(["compliance", str(steel(tmp_path, soft_mm=0.3))]) == 1
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "still soft" in error


def test_what_the_node_took_off_already_is_counted(tmp_path, capsys):
    """Taken off twice, K would have been too large, and nothing had shown it."""
    table = np.loadtxt(steel(tmp_path), delimiter=",", skiprows=1)
    path = tmp_path / "run"
    with BagWriter(path) as writer:
        sample = writer.add_topic("/indenter/sample", "hc_msgs/msg/IndenterSample")
        told = writer.add_topic("/hc/configuration", "hc_msgs/msg/EstimatorConfiguration")
        configuration = EstimatorConfiguration(revision=1, software_version="now")
        value = Parameter(TAKEN_OFF_ALREADY, value=0.001).to_parameter_msg()
        configuration.parameters = [value]
        writer.write(told, 1, serialize_message(configuration))
        for k, (time_s, depth, force) in enumerate(table):
            message = IndenterSample(sequence=k, displacement=(depth - 0.001 * force) * 1e-3)
            message.force = force
            set_stamp(message.header.stamp, round(time_s * 1e9))
            writer.write(sample, 1, serialize_message(message))
    assert main(["compliance", str(path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["mm_per_n"] == pytest.approx(0.004, rel=0.02)
    (note,) = [n for n in loaded(path, f"{NAME}=0.003").findings.notes if "already" in n]
    assert note == "its samples are recorded less 0.001 mm/N already: 0.004 in all"


def test_a_tissue_is_no_block_of_steel(capsys):
    """The recording that comes along: pressed deep and fast, K would have been a robot's."""
    assert main(["compliance", str(Path(__file__).resolve().parents[2] / "bags" / "example")]) == 1
    assert "only: press harder, slower" in capsys.readouterr().err


def test_only_part_of_it_is_used_where_that_is_said(tmp_path, capsys):
    path = str(steel(tmp_path))
    assert main(["compliance", path, "--from", "10", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["from_n"] == 10.0
    assert main(["compliance", path, "--from", "30"]) == 1
    assert "none are left above 30 N" in capsys.readouterr().err
    assert main(["compliance", path, "--input", f"{NAME}=0.001"]) == 2
    assert "is what is looked for" in capsys.readouterr().err


def test_the_setting_is_of_any_recording_and_of_none_otherwise(tmp_path):
    with pytest.raises(UserError, match=r"none of .*position\.frame_compliance"):
        loaded(tmp_path / "none.csv", "frame_compliance=0.1")
