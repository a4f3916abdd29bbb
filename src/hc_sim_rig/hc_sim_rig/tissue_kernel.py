"""Compiled tissues: the force that each answers to a penetration, and its inner state.

Equations and their sources are in docs/rig.md. All tissues are passive while their parameters do
not change: over any motion they give back at most what was put in.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.contact import adhesive_force, hunt_crossley_force
from hc_sim_rig.compilation import inlined
from hc_sim_rig.layout import (
    NOW_DAMPING,
    NOW_DISPLACEMENT_EXPONENT,
    NOW_SCALE,
    NOW_STIFFNESS,
    NOW_VELOCITY_EXPONENT,
    TISSUE_ADHESIVE,
    TISSUE_HUNT_CROSSLEY,
    TISSUE_KELVIN_VOIGT,
    TISSUE_LAYERED,
    TISSUE_OF_OTHERS,
    TISSUE_VISCOELASTIC,
    TUNE_DAMPING,
    TUNE_DISPLACEMENT_EXPONENT,
    TUNE_STIFFNESS,
    TUNE_TISSUE_SCALE,
    TUNE_VALUE,
    TUNE_VELOCITY_EXPONENT,
    Y_BRANCHES,
    Y_SIZE,
)
from hc_sim_rig.tissues_of_others import MAY_PULL, force_of_other

BISECTIONS = 32
"""Halvings in the search for a free surface: 10 mm / 2^32 is far below every sensor."""
SURFACE_AT_REST = 1e-6
"""[mm] Dashpots closer to zero than this count as recovered."""
FRICTION_VELOCITY = 0.05
"""[mm/s] Speed at which dry friction has reached tanh(1) of its value (smooth at rest)."""


@inlined
def tissue_now(
    values: NDArray[np.float64],
    config: NDArray[Any],
    tunables: NDArray[np.float64],
    changes: NDArray[np.float64],
    time: float,
    lateral: float,
) -> None:
    """Write the tissue's values of this sample: settings, changes in time, place.

    Args:
        values: (NOW_COLUMNS,) result.
        config: (1,) record.
        tunables: (T, 3) settings.
        changes: (E, CHANGE_COLUMNS) changes in order of time, each relative to the settings.
        time: time since the specimen is there [s].
        lateral: sideways position [mm].
    """
    fixed = config[0]
    stiffness, damping, exponent, velocity_exponent = 1.0, 1.0, 0.0, 0.0
    for k in range(changes.shape[0]):
        begin, duration = changes[k, 0], changes[k, 1]
        if time < begin:
            break
        share = 1.0 if time >= begin + duration else (time - begin) / duration
        stiffness += share * (changes[k, 2] - stiffness)
        damping += share * (changes[k, 3] - damping)
        exponent += share * (changes[k, 4] - exponent)
        velocity_exponent += share * (changes[k, 5] - velocity_exponent)
    if fixed.inclusion_width > 0.0:
        distance = (lateral - fixed.inclusion_centre) / fixed.inclusion_width
        bell = math.exp(-0.5 * distance * distance)
        stiffness *= 1.0 + fixed.inclusion_stiffness * bell
        damping *= 1.0 + fixed.inclusion_damping * bell
    scale = tunables[TUNE_TISSUE_SCALE, TUNE_VALUE]
    values[NOW_STIFFNESS] = tunables[TUNE_STIFFNESS, TUNE_VALUE] * stiffness * scale
    values[NOW_DAMPING] = tunables[TUNE_DAMPING, TUNE_VALUE] * damping * scale
    values[NOW_DISPLACEMENT_EXPONENT] = tunables[TUNE_DISPLACEMENT_EXPONENT, TUNE_VALUE] + exponent
    values[NOW_VELOCITY_EXPONENT] = tunables[TUNE_VELOCITY_EXPONENT, TUNE_VALUE] + velocity_exponent
    values[NOW_SCALE] = scale


@inlined
def signed_power(base: float, exponent: float) -> float:
    """Return sign(base) |base|^exponent."""
    if base == 0.0:
        return 0.0
    return math.copysign(abs(base) ** exponent, base)


@inlined
def viscoelastic_pull(
    surface: float,
    y: NDArray[np.float64],
    stiffness: float,
    exponent: float,
    branches: NDArray[np.float64],
) -> float:
    """Force at a position of the surface, all springs added [N]; negative: it wants to recover."""
    force = stiffness * signed_power(surface, exponent)
    for k in range(branches.shape[0]):
        force += stiffness * branches[k, 0] * signed_power(surface - y[Y_BRANCHES + k], exponent)
    return force


@inlined
def viscoelastic_surface(
    displacement: float,
    y: NDArray[np.float64],
    stiffness: float,
    exponent: float,
    branches: NDArray[np.float64],
) -> float:
    """Where the surface of the viscoelastic tissue stands [mm].

    It is at the tip while the tip presses; a tip that goes back faster than the tissue recovers
    leaves the surface behind, where all springs balance.
    """
    low, high = 0.0, 0.0
    for k in range(branches.shape[0]):
        high = max(high, y[Y_BRANCHES + k])
    if displacement >= high:
        return displacement
    if high < SURFACE_AT_REST:
        return max(displacement, 0.0)
    if displacement > 0.0 and (
        viscoelastic_pull(displacement, y, stiffness, exponent, branches) > 0.0
    ):
        return displacement
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        if viscoelastic_pull(middle, y, stiffness, exponent, branches) > 0.0:
            high = middle
        else:
            low = middle
    return max(0.5 * (low + high), displacement)


@inlined
def layered_force(
    displacement: float,
    velocity: float,
    fixed: Any,
    now: Any,
    scale: float,
    layers: NDArray[np.float64],
) -> float:
    """Force on a needle in layers that rupture [N].

    Args:
        displacement: depth of the tip [mm].
        velocity: its velocity [mm/s].
        fixed: CONFIG record.
        now: STATE record (which layers are ruptured, how deep the tip was).
        scale: factor on all forces.
        layers: (L, LAYER_COLUMNS) table.
    """
    if displacement <= 0.0:
        return 0.0
    force = fixed.shaft_friction * displacement * math.tanh(velocity / FRICTION_VELOCITY)
    if now.layer > 0 and displacement >= now.deepest and velocity > 0.0:
        # The tip begins to cut as the first layer lets go.
        share = 1.0 - now.rupture_factor if now.layer == 1 else 1.0
        force += share * fixed.cutting_force * math.tanh(velocity / FRICTION_VELOCITY)
    if now.layer < layers.shape[0]:
        stretch = displacement - layers[now.layer, 0]
        if stretch > 0.0:
            force += layers[now.layer, 2] * stretch ** layers[now.layer, 3]
    if now.layer > 0 and now.rupture_factor > 0.0:
        last = now.layer - 1
        stretch = displacement - layers[last, 0]
        if stretch > 0.0:
            force += now.rupture_factor * layers[last, 2] * stretch ** layers[last, 3]
    return float(scale * force)


@inlined
def tissue_force(
    displacement: float,
    velocity: float,
    y: NDArray[np.float64],
    rates: NDArray[np.float64],
    config: NDArray[Any],
    state: NDArray[Any],
    values: NDArray[np.float64],
    layers: NDArray[np.float64],
    branches: NDArray[np.float64],
) -> float:
    """Force of the tissue on the tip [N], compression positive.

    Args:
        displacement: penetration [mm].
        velocity: its derivative [mm/s].
        y: (Y_SIZE,) moving state.
        rates: (Y_SIZE,) derivatives of it; those of the tissue's inner state are written.
        config: (1,) record.
        state: (1,) record.
        values: (NOW_COLUMNS,) of tissue_now.
        layers: (L, LAYER_COLUMNS) table.
        branches: (M, BRANCH_COLUMNS) table.
    """
    fixed = config[0]
    force = 0.0
    if fixed.tissue == TISSUE_HUNT_CROSSLEY:
        force = hunt_crossley_force(
            displacement,
            velocity,
            values[NOW_STIFFNESS],
            values[NOW_DAMPING],
            values[NOW_DISPLACEMENT_EXPONENT],
            values[NOW_VELOCITY_EXPONENT],
        )
    elif fixed.tissue == TISSUE_ADHESIVE:
        force = adhesive_force(
            displacement,
            velocity,
            values[NOW_STIFFNESS],
            values[NOW_DAMPING],
            values[NOW_DISPLACEMENT_EXPONENT],
            values[NOW_VELOCITY_EXPONENT],
        )
    elif fixed.tissue == TISSUE_KELVIN_VOIGT:
        if displacement > 0.0:
            spring = values[NOW_STIFFNESS] * displacement
            force = max(0.0, spring + values[NOW_DAMPING] * velocity)
    elif fixed.tissue == TISSUE_VISCOELASTIC:
        stiffness, exponent = values[NOW_STIFFNESS], values[NOW_DISPLACEMENT_EXPONENT]
        surface = viscoelastic_surface(displacement, y, stiffness, exponent, branches)
        for k in range(branches.shape[0]):
            rates[Y_BRANCHES + k] = (surface - y[Y_BRANCHES + k]) / branches[k, 1]
        if surface <= displacement and displacement > 0.0:
            force = viscoelastic_pull(displacement, y, stiffness, exponent, branches)
    elif fixed.tissue == TISSUE_LAYERED:
        force = layered_force(displacement, velocity, fixed, state[0], values[NOW_SCALE], layers)
    elif fixed.tissue >= TISSUE_OF_OTHERS:
        other = fixed.tissue - TISSUE_OF_OTHERS
        rates[Y_BRANCHES:Y_SIZE] = 0.0
        force = force_of_other(
            other,
            displacement,
            velocity,
            values[NOW_STIFFNESS],
            values[NOW_DAMPING],
            values[NOW_DISPLACEMENT_EXPONENT],
            values[NOW_VELOCITY_EXPONENT],
            y[Y_BRANCHES:Y_SIZE],
            rates[Y_BRANCHES:Y_SIZE],
        )
        if not MAY_PULL[other]:
            force = max(0.0, force)
    return force


@inlined
def rupture(
    displacement: float,
    config: NDArray[Any],
    state: NDArray[Any],
    layers: NDArray[np.float64],
    step: float,
) -> None:
    """After a sample: let ruptured layers go, and rupture the next one when it is due."""
    fixed = config[0]
    now = state[0]
    if displacement > now.deepest:
        now.deepest = displacement
    if fixed.rupture_time > 0.0:
        now.rupture_factor *= math.exp(-step / fixed.rupture_time)
    if now.layer < layers.shape[0] and displacement >= layers[now.layer, 1]:
        now.layer += 1
        now.rupture_factor = 1.0
