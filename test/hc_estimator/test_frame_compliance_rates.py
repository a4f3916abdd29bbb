"""Of a robot that gives way the tissue is found where pose and wrench have rates of their own."""

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.kinds import DEFAULT_FILTER
from hc_estimator.stream.frame_compliance import FrameCompliance

TISSUE = (0.5, 0.02, 1.5, 1.0)
STIFFER = 20.0
"""Than the tissue at its deepest, the robot."""


def contact(force_hz, place_hz, seed):
    """Times [s], displacements [mm] and forces [N], one reading each, and the compliance [mm/N]."""
    random = np.random.default_rng(seed)
    rates, phases = random.uniform((0.3, 1.0), (0.8, 2.5)), random.uniform(0.0, 6.28, 2)

    def motion(time_s):
        angles = 2.0 * np.pi * rates * time_s[:, np.newaxis] + phases
        reach = np.array((2.0, 0.8))
        return 1.8 + np.sin(angles) @ reach, np.cos(angles) @ (2.0 * np.pi * rates * reach)

    def force(time_s):
        moves = zip(*motion(time_s), strict=True)
        return np.array([hunt_crossley_force(d, v, *TISSUE) for d, v in moves])

    of_force, of_place = np.arange(0, 20, 1 / force_hz), np.arange(0, 20, 1 / place_hz) + 0.0007
    largest = float(np.max(force(of_force)))
    mm_per_n = float(np.max(motion(of_force)[0])) / STIFFER / largest
    time_s = np.union1d(of_force, of_place)
    readings = np.full((2, time_s.size), np.nan)
    read = motion(of_place)[0] + mm_per_n * force(of_place)
    readings[0, np.searchsorted(time_s, of_place)] = read + 0.003 * random.standard_normal(
        of_place.size
    )
    readings[1, np.searchsorted(time_s, of_force)] = force(
        of_force
    ) + 0.003 * largest * random.standard_normal(of_force.size)
    return time_s, readings, mm_per_n


def error(time_s, displacement_mm, force_n):
    """How far off K is after 8 s, of itself."""
    estimator = create_estimator(DEFAULT_FILTER, missing_readings=True)
    series = estimator.run(time_s, displacement_mm, force_n)
    return float(np.median(np.abs(np.log(series.parameters[time_s > 8.0, 0] / TISSUE[0]))))


@pytest.mark.parametrize(("force_hz", "place_hz", "most"), [(500, 125, 0.002), (100, 500, 0.012)])
def test_the_last_force_is_enough(force_hz, place_hz, most):
    errors = []
    for seed in range(3):
        time_s, (place, force), mm_per_n = contact(force_hz, place_hz, seed)
        stamps = np.round(time_s * 1e9).astype(np.int64)
        yielded = FrameCompliance(mm_per_n).of_many(stamps, force)
        errors.append((error(time_s, place, force), error(time_s, place - yielded, force)))
    as_read, taken_off = np.median(errors, axis=0)
    assert as_read > 0.03
    assert taken_off < most
