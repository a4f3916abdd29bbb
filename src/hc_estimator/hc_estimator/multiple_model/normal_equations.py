"""Cost of a fit of the contact law to what was felt, with a prior, and its normal equations.

The prior is on ln K, ln (B / K), n and p. What is held (`work.held`) stays at its first guess.
One pass over the points (`gather`) finds all that they say; the prior is added to it as often as
what is held changes, without another pass. The work is done in a record of arrays for four unknowns
or for seven, of which the last three are the contact position, the zero of the force and the delay
of the channels (`zero_fit`).
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
from hc_estimator.linear_algebra import (
    clear_matrix,
    clear_vector,
)
from hc_estimator.multiple_model import history as histories
from hc_estimator.multiple_model.kalman import LARGEST_LOG
from hc_estimator.multiple_model.records import POINTS
from hc_estimator.multiple_model.rows import (
    prior_deviation,
)

HELD_SHARE = 1e-3  # of the prior's deviation that is left to what is held
ANYWHERE = 1e3  # deviation of a zero or a delay that is unknown [mm], [N], [s]
DELAY = 6  # of the unknowns


@compiled
def law_at(
    settings: Any,
    stiffness: float,
    damping: float,
    values: Any,
    depth: float,
    velocity: float,
    out: Any,
) -> float:
    """Force at a point, and its derivatives.

    Args:
        settings: settings record.
        stiffness: K, finite.
        damping: B, finite.
        values: of which n and p are taken, shape (4,).
        depth: [mm].
        velocity: [mm/s].
        out: takes the derivatives after depth, velocity, ln K, ln B, n and p, shape (6,).

    Returns:
        The force [N].
    """
    model = settings.contact_model
    force = contact_gradient(model, depth, velocity, stiffness, damping, values[2], values[3], out)
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
    if not is_plain(model):
        force = law_at(settings, stiffness, damping, values, depth, velocity, gradient)
        change = law_at(settings, stiffness, damping, values, depth, faster, above)
        change -= law_at(settings, stiffness, damping, values, depth, slower, below)
        return force, change
    n, p = values[2], values[3]
    power = displacement_power(depth, n)
    force = plain_gradient(model, depth, power, velocity, stiffness, damping, n, p, gradient)
    change = plain_gradient(model, depth, power, faster, stiffness, damping, n, p, above)
    change -= plain_gradient(model, depth, power, slower, stiffness, damping, n, p, below)
    for out in (gradient, above, below):
        out[2] *= stiffness
        out[3] *= damping
    return force, change


@compiled
def is_used(point: Any, size: int) -> bool:
    """True if a point counts: with so many unknowns, only where a wide cubic shows the motion."""
    return bool(size == 4 or point[7] != 0.0)


@compiled
def velocity_in(history: Any, point: Any, size: int) -> float:
    """Velocity at a point [mm/s] in a fit with so many unknowns."""
    return velocity_at(history, point) if size == 4 else float(point[5])


@compiled
def velocity_at(history: Any, point: Any) -> float:
    """Velocity at a point [mm/s]."""
    return point[1] + history.cubic_share * point[4]  # type: ignore[no-any-return]


@compiled
def sensitivity(gradient: Any, i: int) -> float:
    """Derivative of the force after an unknown (0 to 6): ln K, ln B, n, p, zeros or delay."""
    if i < 4:
        return gradient[2 + i]  # type: ignore[no-any-return]
    if i == DELAY:
        return gradient[DELAY]  # type: ignore[no-any-return]
    return -gradient[0] if i == 4 else 1.0


@compiled
def _note_delay(gradient: Any, velocity: float, acceleration: float) -> None:
    """The derivative after the delay: later is where the tool was before."""
    if gradient.shape[0] > DELAY:
        gradient[DELAY] = -gradient[0] * velocity - gradient[1] * acceleration


@compiled
def exp_limited(logarithm: float) -> float:
    """K or B of its logarithm, finite."""
    return math.exp(min(max(logarithm, -LARGEST_LOG), LARGEST_LOG))


@compiled
def weigh(settings: Any, history: Any, work: Any, force_noise: float) -> float:
    """Give each point its weight by the law at work.fit: the motion is not exact either.

    Args:
        settings: settings record.
        history: its points are changed.
        work: its fit is read, its gradient is changed.
        force_noise: variance of a point's force by its share in the information [N^2].

    Returns:
        Summed variance of the points' forces [N^2].
    """
    fit, gradient = work.fit, work.gradient
    stiffness, damping = exp_limited(fit[0]), exp_limited(fit[1])
    size = fit.shape[0]
    position = fit[4] if size > 4 else 0.0
    delay = fit[DELAY] if size > DELAY else 0.0
    noise = history.velocity_noise[0 if size == 4 else 1]
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        if not is_used(point, size):
            continue
        velocity = velocity_in(history, point, size)
        depth = point[0] - position - delay * velocity
        velocity -= delay * point[6]
        law_at(settings, stiffness, damping, fit, depth, velocity, gradient)
        variance = force_noise + gradient[1] * gradient[1] * noise
        total += variance
        point[3] = 1.0 / variance
    return total


@compiled
def gather(settings: Any, history: Any, work: Any, values: Any) -> float:
    """What the points say about the unknowns, by the weights that they have.

    What noise of the velocity adds to the squares on average is taken off: it grows with the
    damping, so that a fit would call every damping too small (errors in variables; corrected least
    squares, Nakamura, Biometrika 77, 1990). Where a velocity is off by e, the gradient g of the
    force is off by e dg/dv, and the sum of w g g' holds w var(e) (dg/dv)(dg/dv)' that is no
    information (`work.false`).

    Args:
        settings: settings record.
        history: points.
        work: `seen`, `pull` and `false` are set: normal equations of the squares at `values`,
            and what of `seen` is only noise of the velocity.
        values: ln K, ln B, n and p, and what else is unknown, shape (4,) or (7,).

    Returns:
        Weighted sum of squares.
    """
    seen, pull, false = work.seen, work.pull, work.false
    gradient, above, below = work.gradient, work.above, work.below
    size = pull.shape[0]
    stiffness, damping = exp_limited(values[0]), exp_limited(values[1])
    position = values[4] if size > 4 else 0.0
    zero = values[5] if size > 4 else 0.0
    delay = values[DELAY] if size > DELAY else 0.0
    spread = history.velocity_std[0 if size == 4 else 1]
    clear_vector(pull)
    clear_matrix(seen)
    clear_matrix(false)
    total = 0.0
    for k in range(histories.oldest(history), history.count):
        point = history.points[k % POINTS]
        if not is_used(point, size):
            continue
        velocity, weight, acceleration = velocity_in(history, point, size), point[3], point[6]
        depth = point[0] - position - delay * velocity
        velocity -= delay * acceleration
        if spread > 0.0:
            force, change = law_beside(
                settings, stiffness, damping, values, depth, velocity, spread, work
            )
        else:
            force = law_at(settings, stiffness, damping, values, depth, velocity, gradient)
            change = 0.0
        _note_delay(gradient, velocity, acceleration)
        residual = point[2] - zero - force
        total += weight * residual * residual
        for i in range(size):
            share = weight * sensitivity(gradient, i)
            pull[i] += share * residual
            for j in range(i + 1):
                seen[i, j] += share * sensitivity(gradient, j)
        if spread <= 0.0:
            continue
        _note_delay(above, velocity + spread, acceleration)
        _note_delay(below, velocity - spread, acceleration)
        total -= 0.25 * weight * change * change
        for i in range(size):
            share = 0.25 * weight * (sensitivity(above, i) - sensitivity(below, i))
            pull[i] += share * change
            for j in range(i + 1):
                false[i, j] += share * (sensitivity(above, j) - sensitivity(below, j))
    for i in range(size):
        fixed = deviation_in(settings, work, i) <= 0.0
        if fixed:
            pull[i] = 0.0
        for j in range(i + 1):
            if fixed or deviation_in(settings, work, j) <= 0.0:
                seen[i, j] = 0.0
                false[i, j] = 0.0
            seen[j, i] = seen[i, j]
            false[j, i] = false[i, j]
    return total


@compiled
def deviation_in(settings: Any, work: Any, i: int) -> float:
    """Deviation of an unknown (ln K, ln (B / K), n, p, zeros) about its first guess; 0 for none."""
    if i >= 4:
        return ANYWHERE if work.held[i] == 0 else 0.0
    share = HELD_SHARE if work.held[i] != 0 else 1.0
    return share * prior_deviation(settings, i)


@compiled
def prior_off(settings: Any, work: Any, values: Any, i: int) -> float:
    """Distance of an unknown from its first guess, in deviations; 0 if it is none."""
    deviation = deviation_in(settings, work, i)
    if deviation == 0.0 or (i == 1 and prior_deviation(settings, 0) == 0.0):
        return 0.0
    if i == 0:
        off = values[0] - math.log(settings.initial_stiffness)
    elif i == 1:
        guess = math.log(settings.initial_damping / settings.initial_stiffness)
        off = values[1] - values[0] - guess
    elif i == 2:
        off = values[2] - settings.initial_displacement_exponent
    elif i == 3:
        off = values[3] - settings.initial_velocity_exponent
    else:
        off = values[i]
    return off / deviation  # type: ignore[no-any-return]


@compiled
def prior_cost(settings: Any, work: Any, values: Any) -> float:
    """Squared distance from the prior."""
    total = 0.0
    for i in range(values.shape[0]):
        total += prior_off(settings, work, values, i) ** 2
    return total


@compiled
def add_prior(settings: Any, work: Any, values: Any, weight: float) -> None:
    """Normal equations of the cost, from what was gathered at `values`, by a weight of it.

    Args:
        settings: settings record.
        work: `information` and `slope` are set.
        values: the unknowns, shape (4,) or (7,).
        weight: of the squares beside the prior.
    """
    information, slope = work.information, work.slope
    size = slope.shape[0]
    for i in range(size):
        slope[i] = weight * work.pull[i]
        for j in range(size):
            information[i, j] = weight * work.seen[i, j]
    for i in range(size):
        deviation = deviation_in(settings, work, i)
        if deviation <= 0.0:
            information[i, i] = 1.0
            continue
        off = prior_off(settings, work, values, i) / deviation
        square = 1.0 / (deviation * deviation)
        slope[i] -= off
        information[i, i] += square
        if i == 1 and prior_deviation(settings, 0) > 0.0:
            slope[0] += off
            information[0, 0] += square
            information[1, 0] -= square
            information[0, 1] -= square
