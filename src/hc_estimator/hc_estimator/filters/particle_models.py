"""The state space's functions for all particles of `sir_pf` in one call.

Particles stand as a structure of arrays: plane i, shape (count,), holds state i of every particle.
With the Hunt-Crossley law itself the loops have no branch and become vector loops; other laws go
through the state space's own functions, particle by particle, and give what those give.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled
from hc_estimator.contact.hunt_crossley import LARGEST_EXPONENT, TINY
from hc_estimator.contact.registry import (
    ADHESIVE,
    LARGEST_DISPLACEMENT_EXPONENT,
    LARGEST_VELOCITY_EXPONENT,
    SMALLEST_DISPLACEMENT_EXPONENT,
    SMALLEST_VELOCITY_EXPONENT,
    is_plain,
)
from hc_estimator.linear_algebra import copy_matrix, copy_vector
from hc_estimator.state_space import registry as state_space
from hc_estimator.state_space.kinematic import LARGEST_LOG
from hc_estimator.vector_mathematics import exponential, logarithm
from hc_msgs_py.compilation import inlined_always

INFINITE = np.inf


@inlined_always
def _limited(value: float, low: float, high: float) -> float:
    value = low if value < low else value
    return high if value > high else value


@inlined_always
def _powers(d: float, v: float, n: float, p: float) -> tuple[float, float]:
    """Logarithms of d^n and of d^n |v|^p; anything where d or the speed is none."""
    n = _limited(n, SMALLEST_DISPLACEMENT_EXPONENT, LARGEST_DISPLACEMENT_EXPONENT)
    p = _limited(p, SMALLEST_VELOCITY_EXPONENT, LARGEST_VELOCITY_EXPONENT)
    elastic = n * logarithm(d if d > TINY else TINY)
    speed = abs(v)
    drag = elastic + p * logarithm(speed if speed > TINY else TINY)
    elastic = LARGEST_EXPONENT if elastic > LARGEST_EXPONENT else elastic
    return elastic, LARGEST_EXPONENT if drag > LARGEST_EXPONENT else drag


@inlined_always
def _force(d: float, v: float, spring: float, drag: float, smallest: float) -> float:
    """The law's force of its two parts, each without a sign, and no less than the smallest."""
    drag = drag if v > TINY else (-drag if v < -TINY else 0.0)
    force = spring + drag
    force = smallest if force < smallest else force  # what is no number stays none
    return 0.0 if d <= TINY else force


@compiled
def _forces_of_logarithms(
    smallest: float, planes: NDArray[np.float64], forces: NDArray[np.float64]
) -> None:
    """Forces of `kinematic` particles: planes 3 and 4 hold ln K and ln B."""
    d, v, stiffness, damping = planes[0], planes[1], planes[3], planes[4]
    n, p = planes[5], planes[6]
    for k in range(forces.shape[0]):
        elastic, drag = _powers(d[k], v[k], n[k], p[k])
        spring = exponential(_limited(stiffness[k], -LARGEST_LOG, LARGEST_LOG) + elastic)
        damper = exponential(_limited(damping[k], -LARGEST_LOG, LARGEST_LOG) + drag)
        forces[k] = _force(d[k], v[k], spring, damper, smallest)


@compiled
def _forces_of_values(
    smallest: float, planes: NDArray[np.float64], forces: NDArray[np.float64]
) -> None:
    """Forces of `paper` particles: planes 3 and 4 hold K and B."""
    d, v, stiffness, damping = planes[0], planes[1], planes[3], planes[4]
    n, p = planes[5], planes[6]
    for k in range(forces.shape[0]):
        elastic, drag = _powers(d[k], v[k], n[k], p[k])
        spring, damper = stiffness[k] * exponential(elastic), damping[k] * exponential(drag)
        forces[k] = _force(d[k], v[k], spring, damper, smallest)


@compiled
def process(
    settings: Any, memory: Any, planes: NDArray[np.float64], moved: NDArray[np.float64]
) -> None:
    """Process function without noise over memory.elapsed.

    Args:
        settings: settings record.
        memory: memory record.
        planes: states, shape (7, count).
        moved: takes the next states, shape (7, count).
    """
    elapsed, count = memory.elapsed, moved.shape[1]
    if settings.state_space != state_space.KINEMATIC and not is_plain(settings.contact_model):
        for k in range(count):
            for i in range(7):
                memory.point[i] = planes[i, k]
            state_space.process(settings, elapsed, memory.point, memory.images[0])
            for i in range(7):
                moved[i, k] = memory.images[0, i]
        return
    copy_matrix(planes, moved)
    d, v, w = moved[0], planes[1], moved[6]
    share = state_space.lag(settings, elapsed)
    if share != 0.0:
        for k in range(count):
            w[k] += share * (v[k] - w[k])
    if settings.state_space == state_space.KINEMATIC:
        half = 0.5 * elapsed * elapsed
        a, faster = planes[2], moved[1]
        for k in range(count):
            d[k] += elapsed * v[k] + half * a[k]
            faster[k] += elapsed * a[k]
    else:
        for k in range(count):
            d[k] += elapsed * v[k]
        _forces_of_values(_smallest(settings), planes, moved[2])


@compiled
def _smallest(settings: Any) -> float:
    """Smallest force of a plain law: it pulls, or it does not."""
    return -INFINITE if settings.contact_model == ADHESIVE else 0.0


@compiled
def measure(
    settings: Any, memory: Any, planes: NDArray[np.float64], forces: NDArray[np.float64]
) -> None:
    """The force of the measurement function; the displacement is plane 0 itself.

    Args:
        settings: settings record.
        memory: memory record.
        planes: states, shape (7, count).
        forces: takes the forces [N], shape (count,).
    """
    if settings.state_space != state_space.KINEMATIC:
        copy_vector(planes[2], forces)
    elif is_plain(settings.contact_model):
        _forces_of_logarithms(_smallest(settings), planes, forces)
    else:
        for k in range(forces.shape[0]):
            for i in range(7):
                memory.point[i] = planes[i, k]
            state_space.measure(settings, memory.point, memory.outputs[0])
            forces[k] = memory.outputs[0, 1]


@compiled
def constrain(settings: Any, planes: NDArray[np.float64]) -> None:
    """Project the parameters into their physical range (`state_space.constrain`)."""
    if state_space.is_literal(settings):
        return
    for i in range(3, 7):
        low, high = state_space.limits(settings, i)
        plane = planes[i]
        for k in range(plane.shape[0]):
            plane[k] = _limited(plane[k], low, high)
