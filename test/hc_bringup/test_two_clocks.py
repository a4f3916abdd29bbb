"""Stamps of two clocks are named, by the doctor and by every command, and put together."""

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_bringup.diagnosis import diagnose


def test_a_delay_that_grows_is_of_two_clocks_and_no_offset_is_proposed():
    """Regression: of clocks that drift apart the delay of the end was said, for the whole."""
    generator = np.random.default_rng(3)
    time_s = np.arange(24_000) / 200.0
    phase = 2.0 * np.pi * (0.9 * time_s + 0.6 * np.sin(time_s / 3.0))
    depth = -0.5 + 1.5 * (1.0 - np.cos(phase)) * (1.0 + 0.2 * np.sin(0.9 * time_s))
    speed = np.gradient(depth, time_s)
    inside = np.maximum(depth, 0.0) ** 1.5
    force = np.maximum(inside * (0.5 + 0.01 * np.sign(speed) * np.abs(speed) ** 0.8), 0.0)
    late_s = 3e-4 * time_s
    seen = np.interp(time_s - late_s, time_s, force) + 0.01 * generator.standard_normal(24_000)
    found = diagnose(time_s, depth + 0.003 * generator.standard_normal(24_000), seen)
    (drifts,) = [f for f in found.findings if "two clocks" in f.what]
    rate = float(drifts.what.split(" by ")[1].split(" us ")[0])
    assert rate == pytest.approx(300.0, rel=0.1)
    assert drifts.settings == {}
    assert not any("time_offset" in f.settings for f in found.findings)


def of_two_clocks():
    """Presses of half a minute; the position's clock goes 0.2 % fast."""
    generator = np.random.default_rng(4)
    fine = np.arange(0.0, 31.0, 0.001)
    depth = 1.5 - 2.0 * np.cos(2.0 * np.pi * (0.5 * fine + 0.3 * np.sin(0.7 * fine)))
    speed, inside = np.gradient(depth, fine), np.maximum(depth, 0.0) ** 1.4
    force = np.maximum(inside * (0.6 + 0.012 * speed), 0.0)
    time_s = np.arange(7_500) / 250.0
    noise = generator.normal(0.0, 1.0, (2, len(time_s)))
    seen = np.interp(time_s / 1.002, fine, depth) + 0.003 * noise[0]
    return time_s, seen, np.interp(time_s, fine, force) + 0.005 * noise[1]


def test_clocks_that_go_unlike_are_named_and_put_together():
    """Of them the law did not fit, for "relaxing or layered tissue, a tool that slides, ..."."""
    found = diagnose(*of_two_clocks())
    (clocks,) = found.findings
    assert clocks.what.startswith("the position falls behind the force by ")
    rate = float(clocks.what.split(" by ")[1].split(" us ")[0])
    assert rate == pytest.approx(2000.0, rel=0.03)
    assert clocks.what.endswith(
        "ms in 30 s: their stamps are of two clocks, and no one offset serves; stamp both by one "
        "clock (PTP, chrony), or where they arrive"
    )
    assert clocks.settings == {}
    assert "K was" in clocks.cost
    assert found.estimated.parameters[:3] == pytest.approx([0.6, 0.012, 1.4], rel=0.03)


@pytest.mark.parametrize("words", [["estimate"], ["report", "-o", "page.html"], ["batch"]])
def test_commands_name_clocks_that_go_unlike(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    table = np.column_stack(of_two_clocks())
    header = "time_s,displacement_mm,force_N"
    np.savetxt("two.csv", table, delimiter=",", header=header, comments="", fmt="%.7g")
    command, *others = words
    others += ["-o", "out"] if command == "batch" else []
    main([command, "two.csv", *others])
    captured = capsys.readouterr()
    said = captured.out + captured.err
    if command == "batch":
        said = (tmp_path / "out" / "recordings.csv").read_text()
    assert "their stamps are of two clocks, and no one offset serves" in said
    assert "hc doctor says K, B, n and p with that put right" in said
