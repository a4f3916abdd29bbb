"""A structure that gives way between where the position is read and the tip.

A sensor that bends, a thin shaft, a long arm: the position goes on by the compliance times the
force, and the tip does not. To the law that is another tissue; but the speed of the tip is then
less than it looks while the force rises, and that no tissue explains. So each compliance is tried
on the law itself. Slow presses alone show none: it is then as if K were less.
"""

from __future__ import annotations

import dataclasses
from typing import Final

import numpy as np
from numpy.typing import NDArray

from hc_bringup.finding import Finding, cost_of, cures
from hc_bringup.robot_mechanics import COMPLIANCE
from hc_bringup.treated_samples import Estimated, Samples
from hc_bringup.tried_on_law import explains, least_between, left_by_law
from hc_estimator.stream.frame_compliance import FrameCompliance
from hc_evaluation.channels import ChannelDiagnosis

Array = NDArray[np.float64]

MOST_NOISES: Final = 1.06
"""What the law may leave of the force with the compliance taken off: noise, and nothing else."""
LEAST_NOISES: Final = 1.04
"""What it leaves at least with a delay and other zeros."""
LEAST_GAIN: Final = 2.5
"""Times by which it leaves less, beyond the noise and by mean square."""
LEAST_SHARE: Final = 0.01
LARGEST_SHARE: Final = 0.7
"""Of the stroke: what the structure gives way by in all."""
_COARSE: Final = 10
_FINE: Final = 12
_ROWS: Final = 4000
"""That a compliance is tried on at first."""


def find_yielding(even: tuple[Array, Array, Array], found: ChannelDiagnosis) -> float:
    """Return the compliance that explains what a delay and zeros do not [mm/N]; 0 for none.

    Args:
        even: evenly spaced stamps [s], penetration [mm] and force [N], each of shape (n,).
        found: what the law leaves with a delay and other zeros.
    """
    if found.residual_rms_n <= LEAST_NOISES * found.noise_n:
        return 0.0
    few = tuple(column[:: max(1, len(even[0]) // _ROWS)] for column in even)
    softest = float(np.ptp(even[1]) / np.ptp(even[2]))  # mm/N: nothing but the structure moves

    def judged(share: float, readings: tuple[Array, ...]) -> tuple[float, float]:
        time_s, position_mm, force_n = readings
        return left_by_law(time_s, position_mm - share * softest * force_n, force_n)

    # The nearer to the compliance, the less is left: mostly the first says that it is none.
    shares, best, least = np.linspace(0.0, LARGEST_SHARE, _COARSE + 1), 0, judged(0.0, few)[0]
    while best < _COARSE and (rest := judged(shares[best + 1], few)[0]) < least:
        best, least = best + 1, rest
    if not best:
        return 0.0
    low, high = shares[best - 1], shares[min(best + 1, _COARSE)]
    share = least_between(lambda share: judged(share, even)[0], low, high, _FINE)
    is_one = explains(judged(share, even), found, MOST_NOISES, LEAST_GAIN)
    return share * softest if is_one and share > LEAST_SHARE else 0.0


def yielding_taken_off(
    samples: Samples, before: Estimated | None, mm_per_n: float
) -> tuple[list[Finding], Estimated | None]:
    """Take a compliance off the position; return what was found, and what the samples give then.

    Args:
        samples: they are put right, if the law fits then.
        before: what they give.
        mm_per_n: how much the structure gives way.
    """
    mm_per_n = float(f"{mm_per_n:.3g}")
    stamps = np.rint(1e9 * (samples.time_s - samples.time_s[0])).astype(np.int64)
    yielded_mm = FrameCompliance(mm_per_n).of_many(stamps, samples.force_n)
    tried = dataclasses.replace(samples, displacement_mm=samples.displacement_mm - yielded_mm)
    after = tried.estimate()
    if not cures(before, after):
        return [], before
    samples.take_over(tried)
    most_mm = float(np.nanmax(yielded_mm))
    what = (
        f"the structure gives way: the position seems to go on by {mm_per_n:g} mm/N, up to "
        f"{most_mm:.2g} mm, while the tip does not (a sensor that bends, a thin shaft, a long "
        "arm), and K, B, n and p are no surer than that number: measure it with presses on a block "
        "of steel (hc compliance)"
    )
    cost = cost_of(before, after, True)
    return [Finding(what, {COMPLIANCE: mm_per_n}, cost)], after
