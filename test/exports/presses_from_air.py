"""Contacts from the air and back, drawn with a trouble each, and presses of a tool that has a mass.

Sines, presses and ramps from the air of 0.2 to 5 mm into tissues of 0.05 to 3 N/mm, read at 60 to
1000 Hz, each with one trouble of another kind.
"""

from typing import Any

import numpy as np
from scipy.ndimage import gaussian_filter1d
from scipy.signal import butter, lfilter


def nothing(draw, contact):
    del draw, contact


def drift(draw, contact):
    time_s = contact["time"]
    contact["force"] += draw.uniform(-0.1, 0.1) * contact["most"] * time_s / time_s[-1]


def late(draw, contact):
    lag = max(1, int(draw.uniform(0.0, 0.06) * contact["rate"]))
    contact["force"] = np.r_[np.full(lag, contact["force"][0]), contact["force"][:-lag]]


def adhesion(draw, contact):
    place, out = contact["place"], np.gradient(contact["place"]) < 0.0
    held = out & (place > 0.3 * np.min(place)) & (place < 0.1 * np.max(place))
    contact["force"] = contact["force"] - draw.uniform(0.01, 0.1) * contact["most"] * held


def low_pass(draw, contact):
    rate = contact["rate"]
    numerator, denominator = butter(2, min(draw.uniform(3.0, 20.0), 0.4 * rate), fs=rate)
    contact["force"] = lfilter(numerator, denominator, contact["force"])


def creep(draw, contact):
    contact["force"] = contact["force"] + 0.02 * slowly(contact, draw.uniform(1.0, 10.0))


def relaxing(draw, contact):
    left = contact["force"] - 0.4 * slowly(contact, draw.uniform(0.2, 3.0))
    contact["force"] = np.maximum(0.0, left)


def weight(draw, contact):
    share = draw.uniform(0.005, 0.05) * contact["most"] / np.max(contact["place"])
    contact["force"] = contact["force"] + share * contact["place"]


def steps(draw, contact):
    quantum = contact["most"] / 200.0
    contact["readers"] = (
        lambda place: np.round(place / 0.01) * 0.01,
        lambda force: np.round(force / quantum) * quantum,
    )


def held(draw, contact):
    contact["readers"] = (
        lambda place: place,
        lambda force: np.repeat(force[::4], 4)[: len(force)],
    )


def slowly(contact, seconds):
    """The force through a low-pass of the first order."""
    pole = np.exp(-1.0 / (seconds * contact["rate"]))
    return lfilter([1.0 - pole], [1.0, -pole], contact["force"])


def readings(trouble, seed):
    """Displacements [mm], forces [N] and a function that makes forces with a friction of them."""
    draw = np.random.default_rng([seed, 17])
    rate = float(draw.choice([60, 100, 200, 500, 1000]))
    time = np.arange(0.0, draw.uniform(4.0, 20.0), 1.0 / rate)
    stiffness = np.exp(draw.uniform(np.log(0.05), np.log(3.0)))
    depth, air, pace = draw.uniform(1.0, 8.0), draw.uniform(0.2, 5.0), draw.uniform(0.1, 1.5)
    share = (
        0.5 - 0.5 * np.cos(2.0 * np.pi * pace * time),
        0.5 - 0.4 * np.cos(2.0 * np.pi * pace * time) + 0.1 * np.sin(5.4 * np.pi * pace * time),
        np.interp(time / time[-1], [0.2, 0.4, 0.6, 0.8], [0.0, 1.0, 1.0, 0.0]),
        np.interp(pace * time % 1.0, [0.1, 0.4, 0.6, 0.9], [0.0, 1.0, 1.0, 0.0]),
    )[draw.integers(4)]
    place = gaussian_filter1d(-air + (depth + air) * share, max(1.0, 0.02 * rate))
    velocity = np.gradient(place, time)
    inside = np.maximum(place, 0.0) ** draw.uniform(1.0, 2.0)
    force = np.maximum(0.0, inside * stiffness * (1.0 + draw.uniform(0.0, 0.1) * velocity))
    contact: dict[str, Any] = {
        "time": time,
        "rate": rate,
        "place": place,
        "force": force,
        "most": np.max(force),
        "readers": (lambda place: place, lambda force: force),
    }
    trouble(draw, contact)
    noise_mm, noise_n = draw.uniform(0.0005, 0.01), draw.uniform(0.0005, 0.02) * contact["most"]
    noise_n = noise_n * draw.standard_normal(len(time))
    of_place, of_force = contact["readers"]

    def with_friction(share):
        rubbed = share * contact["most"] * np.tanh(velocity / 0.2)
        return of_force(contact["force"] + rubbed + noise_n)

    return of_place(place + noise_mm * draw.standard_normal(len(time))), with_friction, contact


TROUBLES = (nothing, drift, late, adhesion, low_pass, creep, relaxing, weight, steps, held)


def presses(damping=0.01, mass_kg=0.3, friction_n=0.0, zero_n=0.0, stiffness=0.4):
    """Presses at 1 and 3.4 Hz from the air: stamps [s], displacements [mm], forces [N]."""
    random = np.random.default_rng(1)
    time_s = np.arange(12_000) * 1e-3
    ramp = np.where(time_s < 1.0, time_s**3 * (10.0 - 15.0 * time_s + 6.0 * time_s**2), 1.0)
    turn = 2.0 * np.pi * time_s
    place = -2.0 + ramp * (4.0 - 3.0 * np.cos(turn) + np.sin(3.4 * turn))
    velocity = np.gradient(place, time_s)
    depth = np.maximum(place, 0.0)
    force = zero_n + stiffness * np.maximum(0.0, depth**1.5 * (1.0 + 0.025 * velocity))
    force += damping * velocity + 1e-3 * mass_kg * np.gradient(velocity, time_s)
    force += friction_n * np.tanh(velocity / 0.2)
    noise = random.standard_normal((2, len(time_s))) * [[0.003], [0.01]]
    return time_s, place + noise[0], force + noise[1]
