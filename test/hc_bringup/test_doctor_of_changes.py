"""hc doctor says when the tissue changed: its parameters are of what came after."""

import json

import numpy as np
import pytest

from hc_bringup.cli import main


@pytest.mark.parametrize("factor", [2.0, 1.0])
def test_a_tissue_that_became_another_is_said_with_the_time(tmp_path, capsys, factor):
    """Regression: "nothing is wrong" and K of the second of two tissues, without a word of it."""
    time_s = np.arange(0.0, 40.0, 0.002)
    depth = -2.0 + 3.0 * (1.0 - np.cos(0.8 * np.pi * time_s))
    speed = np.gradient(depth, time_s)
    law = (0.4 + 0.012 * np.sign(speed) * np.abs(speed)) * np.maximum(depth, 0.0) ** 1.5
    noise = np.random.default_rng(38).standard_normal((2, time_s.size))
    force = np.maximum(law, 0.0) * np.where(time_s < 20.0, 1.0, factor) + 0.01 * noise[1]
    path = tmp_path / "press.csv"
    rows, header = (time_s, depth + 0.003 * noise[0], force), "time_s,displacement_mm,force_N"
    np.savetxt(path, np.column_stack(rows), delimiter=",", header=header, comments="", fmt="%.6f")
    assert main(["doctor", str(path), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["parameters"]["stiffness"] == pytest.approx(0.4 * factor, rel=0.03)
    told = [note for note in found["notes"] if note.startswith("a change of the tissue detected, ")]
    assert len(told) == (factor != 1.0)
    if told:
        at_s = float(told[0].partition(" at ")[2].partition(" s")[0])
        assert 20.0 < at_s < 23.0
        assert told[0].endswith("K, B, n and p are of what came after the last one")
