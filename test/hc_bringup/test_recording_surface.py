"""The surface of a recording is looked for, with --find-surface."""

import argparse
import json
from pathlib import Path

import numpy as np
import pytest

from hc_bringup import recording_input
from hc_bringup.cli import main

K, B, N = 0.5, 0.015, 1.5  # of the tissue


def loaded(path: Path, *settings: str, flags: tuple[str, ...] = ()):
    words = [word for setting in settings for word in ("--input", setting)]
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    return recording_input.load(parser.parse_args([str(path), *flags, *words]))


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
    words = ["estimate", str(path), "--find-surface", "--json", "--param", "find_zeros=false"]
    assert main([*words, "--param", "contact_position_std=0"]) == 0
    exact = json.loads(capsys.readouterr().out)
    assert exact["parameters"] == found["parameters"]
    assert exact["parameters_std"]["stiffness"] < 0.9 * found["parameters_std"]["stiffness"]


def test_the_surface_allows_for_a_position_that_is_late(tmp_path: Path) -> None:
    """Regression: 0.7 mm off and known to 25 um, K 0.11 +- 0.02 of 0.4."""
    generator = np.random.default_rng(6)
    time, late_s = np.arange(5000) * 2e-3, 0.03
    later = np.maximum(time - 1.0, 0.0)
    depth = -1.0 + 2.0 * (1.0 - np.cos(4.0 * later)) + 0.25 * np.sin(19.0 * later)
    speed = np.gradient(depth, time)
    force = np.maximum(np.maximum(depth, 0.0) ** N * (K + B * speed), 0.0)
    seen = np.interp(time - late_s, time, depth) + 200.0
    seen += 0.003 * generator.standard_normal(5000)
    force += 0.01 * generator.standard_normal(5000)
    rows = [
        f"{t!r},{d!r},{f!r}" if k % 16 == 0 else f"{t!r},,{f!r}"
        for k, (t, d, f) in enumerate(np.column_stack([time, seen, force]).tolist())
    ]
    path = tmp_path / "late.csv"
    path.write_text("time_s,displacement_mm,force_N\n" + "\n".join(rows) + "\n")
    found = loaded(path, flags=("--find-surface",))
    off_mm = found.found_zeros["position.zero"] - 200.0
    assert abs(off_mm) < 4.0 * found.contact_position_std_mm < 0.4
    note = found.findings.notes[-1]
    assert "ms late against the force: the surface allows for that" in note
    offset_s = float(note.rpartition("--input position.time_offset=")[2])
    assert offset_s == pytest.approx(-late_s, abs=0.002)
    in_step = loaded(path, f"position.time_offset={offset_s}", flags=("--find-surface",))
    assert "late" not in in_step.findings.notes[-1]
