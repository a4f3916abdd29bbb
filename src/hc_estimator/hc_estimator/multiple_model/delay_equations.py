"""Normal equations of the delay's fit: K, b, n, p, the zeros and the delay, at one candidate.

A point weighs by the noise that its residual has: that of the force, that of the depth times the
law's slope, and that of the velocity times B d^n p |v|^(p-1). At rest the last one is large where
p is below 1, for there |v|^p is mostly noise (errors in variables by effective variance; York, Can.
J. Phys. 44, 1966). What noise of the velocity takes from B is given back (corrected least
squares; Fuller, Measurement Error Models, 1987), for a B that is too small looks like a force that
is early. p is found with the others, and not taken from elsewhere, because a delay and p are next
to one ridge.

The law is K s with the shape s = d^n (1 + b v^p). K is linear, and eliminated (variable projection;
Golub and Pereyra 1973, Kaufman 1975): one K for all points, or where the tissue varies one for each
half second, with a surface of its own (to first order). Where it does not, the surface may be
elsewhere and sink or rise at a steady speed, and the force may have a zero, each within its prior:
what they leave is far more than noise, and was taken for tissue that varies, of which the half
seconds of a press say no delay.

The squares have a derivative by the delay: the score. It is exact at a candidate, where between two
of them interpolation would average the noise of both and draw any least squares to the middle.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.multiple_model.delay_points import count_of
from hc_estimator.multiple_model.delay_records import CANDIDATES, DELAY_POINTS, TEMPERED
from hc_estimator.multiple_model.rows import guess_of, prior_deviation

SMALLEST_VARIANCE = 1e-30  # of a residual [N^2]
SMALLEST_PRIOR = 1e-4  # deviation of an exponent
LEAST_MOTION = 0.3  # share of the squares of the velocities that is no noise, at least
LEAST_ELASTIC = 0.3  # share of the force that K d^n is taken for, where damping takes it away
SURFACE = 0.3  # deviation of the surface of a half second from that of all [mm]
OWN = 2  # unknowns of a half second where the tissue varies
SHALLOWEST = 0.01  # depth below a surface that is elsewhere [mm]
# Unknowns: b, n, p; position and speed of the surface, zero of the force over K. After them comes
# the delay. Products with the columns are summed for each other column, and for three more.
SURFACE_FIRST, UNKNOWNS = 3, 6
LATE = UNKNOWNS
BY_SHAPE, BY_FORCE, BY_DEPTH = 7, 8, 9
# Deviations of position [mm] and speed [mm/s], and of the zero as a share of the usual force.
ZERO_DEVIATIONS = (1.0, 0.1, 0.05)


@compiled
def slowest(variance: float) -> float:
    """Logarithm of the speed [mm/s] below which a velocity is noise of that variance."""
    return 0.5 * math.log(variance) if variance > 0.0 else -math.inf


@compiled
def _depth(finder: Any, k: int, j: int, law: Any) -> float:
    """Depth of a point below the surface of a law [mm]."""
    kept_point = finder.kept_points[k]
    since = kept_point.time - finder.surface_time
    depth = kept_point.candidates[j].displacement - law[4] - law[5] * since
    return max(depth, SHALLOWEST)  # type: ignore[no-any-return]


@compiled
def keep_surface(finder: Any) -> None:
    """Let the surface of every law have its position when the oldest point was felt.

    Where it sinks for minutes, it was nowhere near at the first of all.
    """
    oldest = finder.kept_points[(finder.kept - count_of(finder)) % DELAY_POINTS].time
    for slot in range(CANDIDATES + 1):
        law = finder.law[slot]
        law[4] += law[5] * (oldest - finder.surface_time)
    finder.surface_time = oldest


@compiled
def keep_laws(finder: Any) -> None:
    """Note all laws, for `take_back_laws`."""
    finder.kept_law[:] = finder.law


@compiled
def take_back_laws(finder: Any) -> None:
    """Let all laws be those noted last."""
    finder.law[:] = finder.kept_law


@compiled
def forget_zeros(finder: Any) -> None:
    """Let every law have the surface, and the zero of the force, where they were given."""
    for slot in range(CANDIDATES + 1):
        forget_zeros_of(finder.law[slot])


@compiled
def forget_zeros_of(law: Any) -> None:
    """Let a law have the surface, and the zero of the force, where they were given."""
    law[1 + SURFACE_FIRST :] = 0.0


@compiled
def _has_zeros(finder: Any) -> bool:
    """True if surface and zero of the force are unknown, and the same for all half seconds."""
    return bool(finder.zeros != 0 and finder.varies == 0)


@compiled
def weigh(finder: Any, j: int) -> None:
    """Set the weights of all points by the law of a candidate.

    Args:
        finder: depth_noise[0] is the variance of a point's depth [mm^2]; weights of the points
            that are kept are set.
        j: candidate.
    """
    law = finder.law[j]
    for k in range(count_of(finder)):
        kept_point = finder.kept_points[k]
        candidate, force = kept_point.candidates[j], kept_point.force
        least = slowest(kept_point.velocity_noise)
        slope = law[2] * force / _depth(finder, k, j, law)
        rate = math.copysign(math.exp(law[3] * candidate.log_speed), candidate.velocity)
        elastic = force / max(1.0 + law[1] * rate, LEAST_ELASTIC)
        swing = (
            elastic * law[1] * law[3] * math.exp((law[3] - 1.0) * max(candidate.log_speed, least))
        )
        variance = kept_point.force_noise + slope * slope * finder.depth_noise[0]
        variance += swing * swing * kept_point.velocity_noise
        kept_point.weight = 1.0 / max(variance, SMALLEST_VARIANCE)


@compiled
def temper(settings: Any, finder: Any, j: int) -> None:
    """Let each half second with its own K weigh by what the law of a candidate leaves of it.

    The noise of each is then unknown, and the logarithm of what is left its log likelihood: else
    the half seconds of which the law says least would decide.

    Args:
        settings: settings record.
        finder: weights of the points that are kept are changed.
        j: candidate.
    """
    add_up(settings, finder, j, finder.law[j])
    count = count_of(finder)
    for k in range(count):
        finder.window_points[finder.kept_points[k].window % TEMPERED] = 0
    for k in range(count):
        finder.window_points[finder.kept_points[k].window % TEMPERED] += 1
    for k in range(count):
        kept_point = finder.kept_points[k]
        window = kept_point.window % TEMPERED
        freedom = max(finder.window_points[window] - OWN, 1)
        kept_point.weight /= max(finder.window_left[window] / freedom, 1.0)


@compiled
def _columns(finder: Any, k: int, j: int, law: Any) -> tuple[float, float, float]:
    """Shape of a point, its derivatives by unknowns and delay in finder.column.

    Returns:
        Shape, its derivative by the depth, and the logarithm of the depth.
    """
    kept_point, column = finder.kept_points[k], finder.column
    candidate = kept_point.candidates[j]
    before = min(j + 1, CANDIDATES // 2 + finder.reach)  # a larger delay is an earlier motion
    after = max(j - 1, CANDIDATES // 2 - finder.reach)
    change = kept_point.candidates[after].velocity - kept_point.candidates[before].velocity
    acceleration = change / ((before - after) * finder.grid_step)
    depth = _depth(finder, k, j, law)
    log_depth = math.log(depth)
    power = math.exp(law[2] * log_depth)
    rate = math.copysign(math.exp(law[3] * candidate.log_speed), candidate.velocity)
    shape = power * (1.0 + law[1] * rate)
    deeper = law[2] * shape / depth
    column[0] = power * rate
    column[1] = shape * log_depth
    column[2] = power * law[1] * rate * candidate.log_speed
    for i in range(SURFACE_FIRST, UNKNOWNS):
        column[i] = 0.0
    if _has_zeros(finder):
        shape += law[UNKNOWNS]
        column[SURFACE_FIRST] = -deeper
        column[SURFACE_FIRST + 1] = -deeper * (kept_point.time - finder.surface_time)
        column[UNKNOWNS - 1] = 1.0
    bends = power * law[1] * law[3] * rate / candidate.velocity * acceleration
    column[LATE] = -(deeper * candidate.velocity + bends)
    return shape, deeper, log_depth


@compiled
def _clear(finder: Any) -> None:
    """Nothing is added up of the points with one K."""
    clear_vector(finder.sums_of_k)
    clear_matrix(finder.moments)


@compiled
def _eliminate(finder: Any, law: Any) -> None:
    """K of the points that were added up, in law[0]; what it leaves goes to the equations."""
    sums, moments, normal, slope = finder.sums_of_k, finder.moments, finder.normal, finder.slope
    if not sums[0] > 0.0:
        return
    stiffness = max(sums[1] / sums[0], 0.0)
    law[0] = stiffness
    square = stiffness * stiffness
    finder.squares += sums[2] - stiffness * (2.0 * sums[1] - stiffness * sums[0])
    push, deeper, away = 0.0, 1.0, 0.0
    if finder.varies != 0 and square > 0.0:  # the surface, as far as K does not explain it
        away = sums[6] / sums[0]
        deeper = sums[7] - away * sums[6] + 1.0 / (square * SURFACE**2)
        push = (sums[8] - away * sums[1]) / deeper
        finder.squares -= push * push * deeper
        law[0] = max(stiffness - push * away, 0.0)
    for i in range(LATE + 1):
        own = moments[BY_DEPTH, i] - away * moments[BY_SHAPE, i] if push != 0.0 else 0.0
        away_from = moments[BY_FORCE, i] - stiffness * moments[BY_SHAPE, i] - push * own
        slope[i] += stiffness * away_from
        for m in range(i + 1):
            share = moments[BY_SHAPE, i] * moments[BY_SHAPE, m] / sums[0]
            if push != 0.0:
                share += own * (moments[BY_DEPTH, m] - away * moments[BY_SHAPE, m]) / deeper
            normal[i, m] += square * (moments[i, m] - share)
    window = finder.window_added % TEMPERED
    finder.window_left[window] = finder.squares - finder.window_before
    finder.window_before = finder.squares
    for i in range(3):
        finder.noise_taken[i] += square * sums[3 + i]


@compiled
def _add_zeros(finder: Any, law: Any, usual: float) -> None:
    """Add what is likely of surface and zero of the force, of which the usual one is given [N]."""
    normal, slope = finder.normal, finder.slope
    for i in range(SURFACE_FIRST, UNKNOWNS):
        deviation = ZERO_DEVIATIONS[i - SURFACE_FIRST]
        if i == UNKNOWNS - 1:
            deviation *= usual / law[0] if law[0] > 0.0 else math.inf
        off = law[1 + i] / deviation
        normal[i, i] += 1.0 / (deviation * deviation)
        slope[i] -= off / deviation
        finder.squares += off * off


@compiled
def add_up(settings: Any, finder: Any, j: int, law: Any) -> float:
    """Normal equations of unknowns and delay at a law (lower triangle), K eliminated, weighted.

    Args:
        settings: settings record, for the priors of n and p.
        finder: normal and slope are set, squares (weighted squares left, those of the priors among
            them), and noise_taken[0], the noise of the velocity in what shows b.
        j: candidate.
        law: K, b, n, p, surface and zero; K is set.

    Returns:
        squares less what noise of the velocity adds to them.
    """
    normal, slope, column = finder.normal, finder.slope, finder.column
    clear_vector(slope)
    clear_matrix(normal)
    clear_vector(finder.noise_taken)
    finder.squares, finder.window_before = 0.0, 0.0
    _clear(finder)
    sums, moments = finder.sums_of_k, finder.moments
    count = count_of(finder)
    finder.added += count
    window, weights = -1, 0.0
    for back in range(count):
        k = (finder.kept - count + back) % DELAY_POINTS
        kept_point = finder.kept_points[k]
        if finder.varies != 0 and kept_point.window != window:
            _eliminate(finder, law)
            _clear(finder)
            window = kept_point.window
            finder.window_added = window
        shape, deeper, log_depth = _columns(finder, k, j, law)
        candidate, force, weight = kept_point.candidates[j], kept_point.force, kept_point.weight
        weights += weight
        sums[6] += weight * shape * deeper
        sums[7] += weight * deeper * deeper
        sums[8] += weight * deeper * force
        sums[0] += weight * shape * shape
        sums[1] += weight * shape * force
        sums[2] += weight * force * force
        for i in range(LATE + 1):
            weighted = weight * column[i]
            moments[BY_SHAPE, i] += weighted * shape
            moments[BY_FORCE, i] += weighted * force
            if finder.varies != 0:
                moments[BY_DEPTH, i] += weighted * deeper
            for m in range(i + 1):
                moments[i, m] += weighted * column[m]
        least = slowest(kept_point.velocity_noise)
        usual = max(candidate.log_speed, least)
        swing = law[3] * column[0] / candidate.velocity
        if candidate.log_speed < least:
            swing = law[3] * math.exp(law[2] * log_depth + (law[3] - 1.0) * least)
        swing *= swing * weight * kept_point.velocity_noise
        sums[3] += swing
        sums[4] += swing * log_depth
        sums[5] += swing * (1.0 / law[3] + usual)
    _eliminate(finder, law)
    taken, b = finder.noise_taken, law[1]
    shown = max(normal[0, 0], 0.0)  # where next to nothing shows b, rounding is all there is
    share = min(1.0, (1.0 - LEAST_MOTION) * shown / taken[0]) if taken[0] > 0.0 else 0.0
    slope[0] += share * b * taken[0]
    slope[1] += share * b * b * taken[1]
    slope[2] += share * b * b * taken[2]
    taken[0] *= share
    for i in range(2):
        deviation = max(prior_deviation(settings, 2 + i), SMALLEST_PRIOR)
        off = (guess_of(settings, 2 + i) - law[2 + i]) / deviation
        normal[1 + i, 1 + i] += 1.0 / (deviation * deviation)
        slope[1 + i] += off / deviation
        finder.squares += off * off
    if _has_zeros(finder):
        _add_zeros(finder, law, math.sqrt(sums[2] / max(weights, 1e-300)))
    return finder.squares - b * b * taken[0]  # type: ignore[no-any-return]
