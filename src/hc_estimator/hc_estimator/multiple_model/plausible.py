"""No row may expect a force far beyond what was ever felt, where depth and speed are not new.

A recursive filter whose linearisation broke down, or that learnt from a wrong motion, can stand at
parameters whose law explodes a moment later. Such a row is no hypothesis any more: it begins anew
from a row that is possible, or, if there is none, from its own stiffness brought down to what was
felt, with parameters let go. (Ours;
`hc bench accuracy ablation`, no force beyond what was felt.)
"""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.compilation import compiled
from hc_estimator.multiple_model.hypotheses import (
    DEPTH,
    LOG_DAMPING,
    LOG_STIFFNESS,
    OWN,
    SURFACE,
    VELOCITY,
)
from hc_estimator.multiple_model.kalman import force_at, force_of_row
from hc_estimator.multiple_model.rows import free_parameters, is_held, seed
from hc_estimator.specification import ParameterSpecification

SPECIFICATIONS = (
    ParameterSpecification(
        "possible_forces",
        "bool",
        True,
        "No hypothesis may expect a force far beyond what was felt where the tool has been.",
    ),
)

LARGEST_FACTOR = 2.5  # of the largest force felt
NOISE = 10.0  # deviations of the force sensor that are added to it
KNOWN_AFTER = 0.1  # in contact before it means anything [s]
LARGEST_FORETOLD = 3.0  # of the largest force felt, where deepest and fastest come together
SURE = 0.2  # deviation of ln K and ln B of a law that is known, whatever it foretells
# Time in contact, once or twice, after which it is forgotten where the tool was and how fast [s]:
# what was taken for its motion in half a second of rubbish bounded the stiffness that is given out.
REMEMBERED = 4.0
NOWHERE = 1e9  # [mm]
DEVIATIONS = (1.0, 1.0, 0.3, 0.1)  # of ln K, ln B, n and p of a row brought down


@compiled
def reset(tool: Any) -> None:
    """Nothing was felt so far."""
    tool.deepest = -NOWHERE
    tool.fastest = 0.0
    _begin_stretch(tool)
    tool.largest_force = 0.0
    tool.known_time = 0.0
    tool.mean_square_force = 0.0
    tool.worthless_time = 0.0


@compiled
def _begin_stretch(tool: Any) -> None:
    """Where the tool was before the stretch that is over will be forgotten after the next one."""
    tool.latest_deepest = -NOWHERE
    tool.latest_fastest = 0.0
    tool.stretch_time = 0.0


@compiled
def learn(tool: Any, row: Any, force: float, elapsed: float) -> None:
    """Take a force reading [N] in contact, the chosen row, and the time since the last one [s]."""
    depth, speed = row.state[DEPTH], abs(row.state[VELOCITY])
    tool.latest_deepest = max(tool.latest_deepest, depth)
    tool.latest_fastest = max(tool.latest_fastest, speed)
    tool.stretch_time += elapsed
    if tool.stretch_time > REMEMBERED:
        tool.deepest, tool.fastest = tool.latest_deepest, tool.latest_fastest
        _begin_stretch(tool)
    tool.deepest = max(tool.deepest, depth)
    tool.fastest = max(tool.fastest, speed)
    tool.largest_force = max(tool.largest_force, force)
    tool.known_time += elapsed
    tool.mean_square_force += min(1.0, elapsed) * (force * force - tool.mean_square_force)
    if row.model_error > tool.mean_square_force:
        tool.worthless_time += elapsed
    else:
        tool.worthless_time = 0.0


@compiled
def move(tool: Any, displacement: float, force: float) -> None:
    """The zeros have moved by so much [mm], [N]; what was felt is the same."""
    if tool.deepest > -NOWHERE:
        tool.deepest -= displacement
        tool.latest_deepest -= displacement
        tool.largest_force = max(tool.largest_force - force, 0.0)


@compiled
def foretells_possible(settings: Any, row: Any, tool: Any) -> bool:
    """False if the row's law says far more than was felt where the tool was deepest and fastest."""
    force = _foretold(settings, row, tool, tool.fastest)
    return bool(force <= LARGEST_FORETOLD * tool.largest_force)


@compiled
def _foretold(settings: Any, row: Any, tool: Any, velocity: float) -> float:
    """Force [N] of the row's law where the tool was deepest, at a velocity [mm/s]."""
    surface = row.state[OWN] if SURFACE[row.index] else 0.0
    return force_at(settings, row, tool.deepest - surface, velocity)


@compiled
def limited_law(settings: Any, row: Any, tool: Any, force_noise: float) -> tuple[float, float]:
    """Ln K and ln B of a row, brought down to what was felt where the tool was deepest and fastest.

    For what is given out. The row itself goes on as it is: bounded by every sample it would learn
    nothing any more.

    Args:
        settings: settings record.
        row: that is given out.
        tool: what was felt.
        force_noise: variance of the force sensor [N^2].
    """
    k, b = row.state[LOG_STIFFNESS], row.state[LOG_DAMPING]
    if settings.possible_forces == 0 or not tool.known_time > KNOWN_AFTER:
        return k, b
    unsure = max(
        row.covariance[LOG_STIFFNESS, LOG_STIFFNESS], row.covariance[LOG_DAMPING, LOG_DAMPING]
    )
    if row.model_error == 0.0 and unsure < SURE * SURE:
        return k, b
    largest = max(tool.largest_force, NOISE * math.sqrt(force_noise))
    foretold = _foretold(settings, row, tool, tool.fastest)
    if foretold <= LARGEST_FORETOLD * largest:
        return k, b
    at_rest = _foretold(settings, row, tool, 0.0)
    damping = foretold - at_rest
    largest_damping = LARGEST_FORETOLD * largest - min(at_rest, LARGEST_FACTOR * largest)
    if at_rest > LARGEST_FACTOR * largest and not is_held(settings, 0):
        k += math.log(LARGEST_FACTOR * largest / at_rest)
    if damping > largest_damping and not is_held(settings, 1):
        b += math.log(largest_damping / damping)
    return k, b


@compiled
def is_no_law(settings: Any, row: Any, tool: Any) -> bool:
    """True if a fit says far more at rest, where the tool was deepest, than was felt there.

    Where the exponent has no bound, least squares may leave it at one that no tissue has.
    """
    if settings.possible_forces == 0 or not tool.known_time > KNOWN_AFTER:
        return False
    return bool(_foretold(settings, row, tool, 0.0) > LARGEST_FORETOLD * tool.largest_force)


@compiled
def check(settings: Any, bank: Any) -> None:
    """Note what every row, predicted to the sample, expects of it; begin impossible ones anew."""
    rows, tool, chosen = bank.rows, bank.tool, bank.judge.chosen
    largest = LARGEST_FACTOR * tool.largest_force + NOISE * math.sqrt(bank.sensor_noise[1])
    looked_long = settings.possible_forces != 0 and tool.known_time > KNOWN_AFTER
    possible = -1
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0:
            continue
        row.predicted_force = force_of_row(settings, row, 0.0)
        if _is_possible(row, tool, looked_long, largest) and (possible < 0 or m == chosen):
            possible = m
    for m in range(rows.shape[0]):
        row = rows[m]
        if row.active == 0 or _is_possible(row, tool, looked_long, largest):
            continue
        if possible >= 0:
            seed(rows[possible], row, tool.contact_clock, tool.contact_clock)
        else:  # the law is scaled to the largest force that is possible, and let go
            shift = math.log(largest / abs(row.predicted_force))
            row.state[LOG_STIFFNESS] += shift
            row.state[LOG_DAMPING] += shift
            free_parameters(settings, row, DEVIATIONS)
        row.predicted_force = force_of_row(settings, row, 0.0)


@compiled
def _is_possible(row: Any, tool: Any, looked_long: bool, largest: float) -> bool:
    """False if the row expects far more than was felt at a depth and a speed that are not new."""
    if not looked_long:
        return True
    if row.state[DEPTH] > tool.deepest or abs(row.state[VELOCITY]) > tool.fastest:
        return True
    return bool(abs(row.predicted_force) <= largest)
