"""Does a surface that a fit has found follow the tool? Then it is tissue that relaxes.

A tissue that relaxes pushes less the longer it is pressed, and lets go early: a surface that sinks
where the tool presses, and comes back, explains that to within the noise. A surface that moves by
itself does not know where the tool is. Their correlation tells them apart (over ten seconds of
drawn presses on relaxing tissue 0.4 to 1, of surfaces that breathe or sink beneath presses and
palpation -0.5 to 0.36; ours, `hc bench accuracy misfit` and `together`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.spline import MOVES, has, locate, second

SHORT, LONG = 0.3, 1.0  # time constants with which the depth is remembered [s]
LARGEST = 0.45  # correlation


@compiled
def follows_tool(history: Any, fit: Any) -> bool:
    """True if the surface of a fit goes with where the tool has been.

    Args:
        history: points of the fit.
        fit: solved; no surface but one that moves can follow.
    """
    if not has(fit, MOVES):
        return False
    most = max(_correlation(history, fit, SHORT), _correlation(history, fit, LONG))
    return bool(most > LARGEST)


@compiled
def _correlation(history: Any, fit: Any, memory: float) -> float:
    """Correlation of the surface with the depth low-passed, both without their trend."""
    remembered, before = history.points[fit.first % POINTS, 0], fit.begin
    t, s, d, tt, ts, td, ss, sd, dd = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(fit.first, fit.last):
        point = history.points[k % POINTS]
        locate(fit, point[8])
        surface, _ = second(fit, fit.values)
        remembered += (1.0 - math.exp((before - point[8]) / memory)) * (point[0] - remembered)
        before = point[8]
        time = point[8] - fit.begin
        t, s, d = t + time, s + surface, d + remembered
        tt, ts, td = tt + time * time, ts + time * surface, td + time * remembered
        ss, sd = ss + surface * surface, sd + surface * remembered
        dd += remembered * remembered
    count = float(fit.last - fit.first)
    tt, ts, td = tt - t * t / count, ts - t * s / count, td - t * d / count
    ss, sd, dd = ss - s * s / count, sd - s * d / count, dd - d * d / count
    both = (ss - ts * ts / tt) * (dd - td * td / tt)
    return (sd - ts * td / tt) / math.sqrt(both) if both > 0.0 else 0.0
