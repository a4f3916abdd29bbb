"""Cost of a fit of the contact law to what was felt, with a prior, and its normal equations.

The prior is on ln K, ln (B / K), n and p. What is held (`history.held`) stays at its first guess.
One pass over the points (`gather`) finds all that they say; the prior is added to it as often as
what is held changes, without another pass.
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.contact.registry import (
    contact_gradient,
    displacement_power,
    is_plain,
    plain_gradient,
)
from hc_estimator.linear_algebra import clear_matrix, clear_vector
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.kalman import exp_limited
from hc_estimator.multiple_model.point_velocity import noise_of, velocity_at
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import guess_of, is_held, prior_deviation

HELD_SHARE = 1e-3  # of the prior's deviation that is left to what is held
TAIL = 2.5  # deviations from the first guess of B / K, beyond which it pulls no harder


@compiled
def law_at(
    settings: Any,
    stiffness: float,
    damping: float,
    n: float,
    p: float,
    depth: float,
    velocity: float,
    out: Any,
) -> float:
    """Force at a point, and its derivatives.

    Args:
        settings: settings record.
        stiffness: K, finite.
        damping: B, finite.
        n: exponent of the depth.
        p: exponent of the velocity.
        depth: [mm].
        velocity: [mm/s].
        out: takes the derivatives after depth, velocity, ln K, ln B, n and p, shape (6,).

    Returns:
        The force [N].
    """
    model = settings.contact_model
    force = contact_gradient(model, depth, velocity, stiffness, damping, n, p, out)
    out[2] *= stiffness
    out[3] *= damping
    return force


@compiled
def law_beside(
    settings: Any,
    stiffness: float,
    damping: float,
    values: Any,
    depth: float,
    velocity: float,
    spread: float,
    work: Any,
) -> tuple[float, float]:
    """Force at a point, and how it changes from a velocity below to one above.

    Args:
        settings: settings record.
        stiffness: K, finite.
        damping: B, finite.
        values: of which n and p are taken, shape (4,).
        depth: [mm].
        velocity: [mm/s].
        spread: from it to either side [mm/s].
        work: `gradient`, `above` and `below` take the derivatives, as in `law_at`.

    Returns:
        Force, and force above less force below [N].
    """
    gradient, above, below = work.gradient, work.above, work.below
    faster, slower = velocity + spread, velocity - spread
    model = settings.contact_model
    n, p = values[2], values[3]
    if not is_plain(model):
        force = law_at(settings, stiffness, damping, n, p, depth, velocity, gradient)
        change = law_at(settings, stiffness, damping, n, p, depth, faster, above)
        change -= law_at(settings, stiffness, damping, n, p, depth, slower, below)
        return force, change
    power = displacement_power(depth, n)
    force = plain_gradient(model, depth, power, velocity, stiffness, damping, n, p, gradient)
    change = plain_gradient(model, depth, power, faster, stiffness, damping, n, p, above)
    change -= plain_gradient(model, depth, power, slower, stiffness, damping, n, p, below)
    for out in (gradient, above, below):
        out[2] *= stiffness
        out[3] *= damping
    return force, change


@compiled
def weigh(settings: Any, history: Any, depth_noise: float, force_noise: float) -> float:
    """Give each point its weight by the law at history.fit: the motion is not exact either.

    Args:
        settings: settings record.
        history: its points and its gradient are changed.
        depth_noise: variance of a point's depth by its share in the information [mm^2].
        force_noise: the same of its force [N^2].

    Returns:
        Summed variance of the points' forces [N^2].
    """
    fit, gradient = history.fit, history.gradient
    stiffness, damping = exp_limited(fit[0]), exp_limited(fit[1])
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        noise = history.velocity_noise[noise_of(history, point)]
        velocity = velocity_at(history, point)
        law_at(settings, stiffness, damping, fit[2], fit[3], point.depth, velocity, gradient)
        variance = force_noise + gradient[0] * gradient[0] * depth_noise
        variance += gradient[1] * gradient[1] * noise
        total += variance
        point.weight = 1.0 / variance
    return total


@compiled
def gather(settings: Any, history: Any, values: Any) -> float:
    """What the points say about the unknowns, by the weights that they have.

    What noise of the velocity adds to the squares on average is taken off: it grows with the
    damping, so that a fit would call every damping too small (errors in variables; corrected least
    squares, Nakamura, Biometrika 77, 1990). Where a velocity is off by e, the gradient g of the
    force is off by e dg/dv, and the sum of w g g' holds w var(e) (dg/dv)(dg/dv)' that is no
    information (`history.false`).

    Args:
        settings: settings record.
        history: points; `seen`, `pull` and `false` are set: normal equations of the squares at
            `values`, and what of `seen` is only noise of the velocity.
        values: ln K, ln B, n and p, shape (4,).

    Returns:
        Weighted sum of squares.
    """
    seen, pull, false = history.seen, history.pull, history.false
    gradient, above, below = history.gradient, history.above, history.below
    stiffness, damping = exp_limited(values[0]), exp_limited(values[1])
    clear_vector(pull)
    clear_matrix(seen)
    clear_matrix(false)
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        depth, velocity, weight = point.depth, velocity_at(history, point), point.weight
        spread = history.velocity_std[noise_of(history, point)]
        force, change = law_beside(
            settings, stiffness, damping, values, depth, velocity, spread, history
        )
        residual = point.force - force
        total += weight * residual * residual
        for i in range(4):
            share = weight * gradient[2 + i]
            pull[i] += share * residual
            for j in range(i + 1):
                seen[i, j] += share * gradient[2 + j]
        total -= 0.25 * weight * change * change
        for i in range(4):
            share = 0.25 * weight * (above[2 + i] - below[2 + i])
            pull[i] += share * change
            for j in range(i + 1):
                false[i, j] += share * (above[2 + j] - below[2 + j])
    for i in range(4):
        fixed = deviation_in(settings, history, i) <= 0.0
        if fixed:
            pull[i] = 0.0
        for j in range(i + 1):
            if fixed or deviation_in(settings, history, j) <= 0.0:
                seen[i, j] = 0.0
                false[i, j] = 0.0
            seen[j, i] = seen[i, j]
            false[j, i] = false[i, j]
    return total


@compiled
def deviation_in(settings: Any, history: Any, i: int) -> float:
    """Deviation of an unknown (ln K, ln (B / K), n, p) about its first guess; 0 for none."""
    share = HELD_SHARE if history.held[i] != 0 else 1.0
    return share * prior_deviation(settings, i)


@compiled
def prior_off(settings: Any, history: Any, values: Any, i: int) -> float:
    """Distance of an unknown from its first guess, in deviations; 0 if it is none."""
    deviation = deviation_in(settings, history, i)
    if deviation == 0.0:
        return 0.0
    off = values[i] - guess_of(settings, i)
    if i == 1:
        guess = math.log(settings.initial_damping / settings.initial_stiffness)
        off = values[1] - values[0] - guess
    return off / deviation  # type: ignore[no-any-return]


@compiled
def _share_of_prior(history: Any, i: int, off: float) -> float:
    """How much a first guess counts so many deviations away: that of B / K has long tails (Huber).

    What hardly damps, as a spring, would be known to damp, by the first guess alone.
    """
    if i != 1 or history.held[i] != 0 or abs(off) <= TAIL:
        return 1.0
    return TAIL / abs(off)


@compiled
def prior_cost(settings: Any, history: Any, values: Any) -> float:
    """Squared distance from the prior, less than that in its tails."""
    total = 0.0
    for i in range(values.shape[0]):
        off = prior_off(settings, history, values, i)
        share = _share_of_prior(history, i, off)
        total += share * (2.0 - share) * off**2
    return total


@compiled
def add_prior(settings: Any, history: Any, values: Any, weight: float) -> None:
    """Normal equations of the cost, from what was gathered at `values`, by a weight of it.

    Args:
        settings: settings record.
        history: `information` and `slope` are set.
        values: the unknowns, shape (4,).
        weight: of the squares beside the prior.
    """
    information, slope = history.information, history.slope
    for i in range(4):
        slope[i] = weight * history.pull[i]
        for j in range(4):
            information[i, j] = weight * history.seen[i, j]
    for i in range(4):
        deviation = deviation_in(settings, history, i)
        if deviation <= 0.0:
            information[i, i] = 1.0
            continue
        off = prior_off(settings, history, values, i)
        share = _share_of_prior(history, i, off)
        off *= share / deviation
        square = share / (deviation * deviation)
        slope[i] -= off
        information[i, i] += square
        if i == 1 and not is_held(settings, 0):
            slope[0] += off
            information[0, 0] += square
            information[1, 0] -= square
            information[0, 1] -= square
