"""A recording of a driver that died, or froze: no parameters are given out without a word."""

import json

import numpy as np

from hc_bringup.cli import main


def write(path, depth, force):
    time_s = np.arange(len(depth)) * 1e-3
    rows = np.column_stack([time_s, depth, force])
    names = "time_s,displacement_mm,force_N"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.7f")
    return str(path)


def test_two_channels_that_stand_still_are_no_tissue(tmp_path, capsys):
    table = write(tmp_path / "still.csv", np.full(4000, 1.0), np.full(4000, 0.5))
    assert main(["estimate", table]) == 1
    said = capsys.readouterr().err
    assert "nothing moves" in said
    assert "these are not the parameters of the tissue" in said
    assert main(["doctor", table, "--json"]) == 1
    said = json.loads(capsys.readouterr().out)
    assert [f["what"].partition(":")[0] for f in said["findings"]] == ["nothing moves"]
    assert "parameters" not in said
    page = tmp_path / "still.html"
    assert main(["report", table, "-o", str(page)]) == 0
    assert "Nothing moves" in page.read_text()
    assert "The filter is honest" not in page.read_text()


def test_a_freeze_in_the_middle_is_told(tmp_path, capsys):
    generator = np.random.default_rng(3)
    times = np.arange(0.0, 10.0, 0.001)
    depth = 1.0 + 1.6 * np.sin(3.1 * times - 1.5) + 0.6 * np.sin(8.2 * times)
    force = 0.3 * np.maximum(depth, 0.0) ** 1.5 + 0.01 * generator.standard_normal(times.size)
    depth += 0.002 * generator.standard_normal(times.size)
    depth[3000:6000], force[3000:6000] = depth[3000], force[3000]
    table = write(tmp_path / "frozen.csv", depth, force)
    assert main(["estimate", table]) == 0
    said = capsys.readouterr().err
    assert "both channels stand still for 3 s" in said
    page = tmp_path / "frozen.html"
    assert main(["report", table, "-o", str(page)]) == 0
    assert "Both channels stand still for 3 s" in page.read_text()
    assert "describes what the sensors say" not in page.read_text()


def test_five_readings_a_second_of_a_quick_motion_and_errors_beyond_all_deviations(
    tmp_path, capsys
):
    """Regression: a mean NIS of 933 stood there, and an error of 3.3 N, without a word."""
    times = np.arange(0.0, 8.0, 0.2)
    depth = 4.0 + 2.5 * np.sin(9.0 * times) + 0.8 * np.sin(23.0 * times)
    speed = 22.5 * np.cos(9.0 * times) + 18.4 * np.cos(23.0 * times)
    force = depth**1.8 * (0.2 + 0.008 * speed)
    rows = np.column_stack([times, depth, force])
    path = tmp_path / "slow.csv"
    names = "time_s,displacement_mm,force_N"
    np.savetxt(path, rows, delimiter=",", header=names, comments="", fmt="%.7f")
    main(["estimate", str(path)])
    said = capsys.readouterr().err
    assert "5 Hz is too low a rate for this motion" in said
    assert "errors are far larger than the filter admits" in said
