"""Less than a stroke of a damped tissue is no channel that counts the other way."""

from pathlib import Path

import numpy as np
import pytest

from hc_estimator.stream.readings import Check
from hc_estimator.stream.sanity import check_samples
from hc_sim_rig.rig import Rig

SCENARIOS = Path(__file__).parents[2] / "config/scenarios"


def signs(time_s, displacement, force):
    doubted = check_samples(time_s, displacement, force)
    return {s.channel for s in doubted if s.check is Check.SIGN}


def test_what_a_run_leaves_that_was_stopped_at_once_is_not_turned():
    """Regression: 0.12 s, force ahead of depth: "turn the sign of the displacement"."""
    series = Rig(SCENARIOS / "lump.yaml", 1).run(0.12)
    columns = (series.time_s, series.displacement_mm, series.force_n)
    assert np.corrcoef(columns[1], columns[2])[0, 1] < -0.4
    assert not signs(*columns)
    assert not signs(columns[0], columns[1], -columns[2]) - {"force"}


@pytest.mark.parametrize("start", [3856, 7193, 18560])
def test_the_end_of_a_way_in_is_no_free_motion_seen_from_below(start):
    """Regression: damping keeps the force flat there: "turn the signs of both"."""
    series = Rig(SCENARIOS / "indentation.yaml", 1).run(20.0)
    piece = slice(start, start + 300)
    columns = (series.time_s, series.displacement_mm, series.force_n)
    assert not signs(*(column[piece] for column in columns))


def test_of_pieces_of_every_length_next_to_none_is_taken_so_and_turned_ones_are_found():
    """Of 3,663 pieces of 0.1 s and more 49 were, now 9; of those turned 84 to 86 % are found."""
    wrong = found = count = 0
    draw = np.random.default_rng(5)
    for name in ("lump", "multisine", "indentation", "tissue_change"):
        series = Rig(SCENARIOS / f"{name}.yaml", 1).run(20.0)
        for length in (120, 300, 1000, 4000):
            for start in draw.integers(0, len(series.time_s) - length, 5):
                time_s, displacement, force = (
                    column[start : start + length]
                    for column in (series.time_s, series.displacement_mm, series.force_n)
                )
                count += 1
                wrong += bool(signs(time_s, displacement, force))
                found += signs(time_s, displacement, -force) == {"force"}
    assert wrong <= 0.02 * count
    assert found >= 0.7 * count
