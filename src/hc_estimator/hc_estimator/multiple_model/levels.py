"""What a force teaches first: the level K + B v^p at the usual speed, not K and B by themselves.

As long as the tool has moved at about one speed, only that level is known, and the likelihood is a
ridge along which K + B v^p stays the same. In ln K and ln B the ridge is bent: points of the
unscented transform leave it, and the law seems so far from linear that nothing is learnt for
seconds (a press at constant speed). In the logarithms of the level and of B / K it is straight.

So a row is normal in ln(K + B w), ln(B / K), n and p, where w is the usual speed to the power of p
(ours). That is so until the tool has retreated for the first time: to and fro no level is known
better than K itself. Mean and covariance are kept in ln K and ln B all the same, the covariance as
that of the tangents: sigma points are moved along the ridge by `moved`, and after an update mean
and covariance follow it (`follow`). What the tangent leaves out is in the covariance that is given
out (`bend_variance`).
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import (
    COUNTS,
    LOG_DAMPING,
    LOG_STIFFNESS,
    VELOCITY,
    VELOCITY_EXPONENT,
)

UNBENT = -1e9  # logarithm of a speed at which the level is K
LARGEST = 300.0  # exponent of exp()
USUAL_TIME = 2.0  # in contact over which the usual velocity is taken, at most [s]
SLOWEST = 1e-3  # [mm/s]
MOVING = 3.0  # deviations of the velocity that are no noise


@compiled
def reset(tool: Any) -> None:
    """The tool has not been in contact yet."""
    tool.usual_velocity = 0.0
    tool.retreated = 0


@compiled
def learn(tool: Any, rows: Any, row: Any, elapsed: float) -> None:
    """Take the velocity of a row in contact into the usual one.

    When the tool retreats for the first time the rows become normal in ln K and ln B: what their
    tangents leave out is added.

    Args:
        tool: changed.
        rows: all of them.
        row: the one in charge.
        elapsed: time in contact [s].
    """
    velocity = row.state[VELOCITY]
    retreats = velocity < -MOVING * math.sqrt(row.covariance[VELOCITY, VELOCITY])
    if retreats and tool.retreated == 0:
        log_speed = log_usual_speed(tool)
        for m in range(rows.shape[0]):
            covariance = rows[m].covariance
            k, b = covariance[LOG_STIFFNESS, LOG_STIFFNESS], covariance[LOG_DAMPING, LOG_DAMPING]
            if rows[m].active != 0 and k > 0.0 and b > 0.0:
                variance = bend_variance(rows[m], log_speed)
                for i in (LOG_STIFFNESS, LOG_DAMPING):
                    for j in (LOG_STIFFNESS, LOG_DAMPING):
                        covariance[i, j] += variance
        tool.retreated = 1
    time = min(max(tool.contact_clock, elapsed), USUAL_TIME)
    share = min(elapsed / time, 1.0) if time > 0.0 else 1.0
    tool.usual_velocity += share * (velocity - tool.usual_velocity)


@compiled
def log_usual_speed(tool: Any) -> float:
    """Logarithm of the usual velocity [mm/s]; UNBENT once the tool has retreated."""
    if tool.retreated != 0:
        return UNBENT
    return math.log(max(tool.usual_velocity, SLOWEST))


@compiled
def share_of_damping(k: float, b: float, p: float, log_speed: float) -> float:
    """Share of B v^p in K + B v^p."""
    if log_speed <= UNBENT:
        return 0.0
    return 1.0 / (1.0 + math.exp(min(k - b - p * log_speed, LARGEST)))


@compiled
def ridge_at(
    k: float, b: float, p: float, log_speed: float
) -> tuple[float, float, float, float, float, float]:
    """The ridge through ln K, ln B and p at a usual speed, as `moved` takes it.

    Returns:
        The four given; share of the damping and logarithm of the level there.
    """
    level = k if log_speed <= UNBENT else k + _log_rest(b - k + p * log_speed)
    return k, b, p, log_speed, share_of_damping(k, b, p, log_speed), level


@compiled
def _log_rest(log_ratio: float) -> float:
    """ln(1 + exp(x)): of the level over K, x being that of B v^p over K."""
    return log_ratio if log_ratio > LARGEST else math.log1p(math.exp(log_ratio))


@compiled
def moved(
    ridge: tuple[float, float, float, float, float, float],
    move_k: float,
    move_b: float,
    move_p: float,
) -> tuple[float, float]:
    """Some way along the ridge, in ln K and ln B; a straight one where the level is K.

    Args:
        ridge: see `ridge_at`.
        move_k: way along the tangent in ln K.
        move_b: in ln B.
        move_p: in p.
    """
    k, b, p, log_speed, share, level = ridge
    ratio = b - k
    ratio += move_b - move_k
    if log_speed <= UNBENT:
        stiffness = level + move_k
    else:
        level += (1.0 - share) * move_k + share * (move_b + log_speed * move_p)
        stiffness = level - _log_rest(ratio + (p + move_p) * log_speed)
    return stiffness, stiffness + ratio


@compiled
def follow(
    row: Any, k: float, b: float, p: float, by_delay_before: float, log_speed: float
) -> None:
    """Bring mean and covariance of a row back onto the ridge after a linear update.

    Its derivative by the error of the delay becomes that of the mean there.

    Args:
        row: changed.
        k: ln K before the update.
        b: ln B before it.
        p: velocity exponent before it.
        by_delay_before: derivative of ln(B w / K) before it; see `log_ratio_by_delay`.
        log_speed: logarithm of the usual speed.
    """
    state, covariance = row.state, row.covariance
    ridge = ridge_at(k, b, p, log_speed)
    share = ridge[4]
    move_k, move_b = state[LOG_STIFFNESS] - k, state[LOG_DAMPING] - b
    move_p = state[VELOCITY_EXPONENT] - p
    k, b = moved(ridge, move_k, move_b, move_p)
    state[LOG_STIFFNESS] = k
    state[LOG_DAMPING] = b
    # The tangents turn by what the share has changed.
    turn = share - share_of_damping(k, b, state[VELOCITY_EXPONENT], log_speed)
    for j in range(COUNTS[row.index]):
        along = covariance[LOG_DAMPING, j] - covariance[LOG_STIFFNESS, j]
        along = turn * (along + log_speed * covariance[VELOCITY_EXPONENT, j])
        covariance[LOG_STIFFNESS, j] += along
        covariance[LOG_DAMPING, j] += along
    for i in range(COUNTS[row.index]):
        along = covariance[i, LOG_DAMPING] - covariance[i, LOG_STIFFNESS]
        along = turn * (along + log_speed * covariance[i, VELOCITY_EXPONENT])
        covariance[i, LOG_STIFFNESS] += along
        covariance[i, LOG_DAMPING] += along
    # With another delay the way would have begun elsewhere, and with another share.
    along = turn * log_ratio_by_delay(row, log_speed)
    way = move_b - move_k + log_speed * move_p
    along += share * (1.0 - share) * by_delay_before * way
    row.by_delay[LOG_STIFFNESS] += along
    row.by_delay[LOG_DAMPING] += along


@compiled
def log_ratio_by_delay(row: Any, log_speed: float) -> float:
    """Derivative of ln(B w / K) by the error of the delay [1/s]."""
    slope = row.by_delay
    ratio = slope[LOG_DAMPING] - slope[LOG_STIFFNESS]
    return float(ratio + log_speed * slope[VELOCITY_EXPONENT])


@compiled
def bend_variance(row: Any, log_speed: float) -> float:
    """Variance of ln K and ln B together that the tangent at the mean leaves out.

    Second moment of the second-order term, -s (1 - s) z^2 / 2 for a share s of the damping and a
    normal z, the error of ln(B w / K).
    """
    state, covariance = row.state, row.covariance
    k, b, p = LOG_STIFFNESS, LOG_DAMPING, VELOCITY_EXPONENT
    share = share_of_damping(state[k], state[b], state[p], log_speed)
    variance = covariance[b, b] + covariance[k, k] - 2.0 * covariance[k, b]
    variance += 2.0 * log_speed * (covariance[b, p] - covariance[k, p])
    variance += log_speed * log_speed * covariance[p, p]
    bend = share * (1.0 - share) * max(variance, 0.0)
    return float(0.75 * bend * bend)
