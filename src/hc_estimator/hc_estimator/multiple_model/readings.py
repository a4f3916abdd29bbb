"""What the readings say by themselves: the sensors' noise, the motion of the tool."""

from __future__ import annotations

import math
from typing import Any

from hc_estimator.adaptation import difference_noise, motion_density, noise_color, resolution
from hc_estimator.adaptation.policy import DIFFERENCES
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import raw_readings, tempering
from hc_estimator.multiple_model.delay_records import RAW
from hc_estimator.multiple_model.kalman import force_at

LARGEST_WAIT = 64  # accepted samples after which the given noise is used if none was found
SUDDEN = 5.0  # latest differences beyond so many times the noise replace it
FLOOR_SHARE = 1e-3  # of the largest force: the most that its noise is believed to be at least


@compiled
def last_displacement(bank: Any) -> float:
    """Latest reading of the displacement [mm]; NaN if there was none since the start or a gap."""
    count = bank.delay.raw_count[0]
    return bank.delay.raw_value[0, (count - 1) % RAW] if count > 0 else math.nan


@compiled
def displacement_before(bank: Any, time: float) -> tuple[float, float]:
    """Latest reading of the displacement [mm] up to a time [s], and how much later that is [s].

    Where the force is late, readings of the displacement are known that belong to none yet. Of
    those that are all later the oldest that is remembered.
    """
    finder = bank.delay
    k = raw_readings.latest_up_to(finder, 0, time)
    return finder.raw_value[0, k % RAW], time - finder.raw_time[0, k % RAW]


@compiled
def since_displacement(bank: Any, time: float) -> float:
    """How much later than that reading a time [s] in the displacement's time is [s]."""
    count = bank.delay.raw_count[0]
    return time - bank.delay.raw_time[0, (count - 1) % RAW] if count > 0 else 0.0


@compiled
def _force_floor(settings: Any, bank: Any) -> float:
    """Smallest deviation of the force's noise that is believed [N].

    Where all forces are small, it is a share of the largest: a sensor of microscopic forces is not
    noisier than they are.
    """
    largest = max(bank.tool.largest_force, abs(bank.clock.measurement[1]))
    for k in range(difference_noise.ORDER + 1):
        largest = max(largest, abs(bank.noise[1].readings[k]))
    floor = settings.force_noise_floor
    return min(floor, FLOOR_SHARE * largest) if largest > 0.0 else floor  # type: ignore[no-any-return]


@compiled
def learn(settings: Any, bank: Any, time: float) -> None:
    """Take the accepted readings into everything that does not depend on the contact law."""
    clock = bank.clock
    broken = clock.restart != 0
    if settings.noise_adaptation == DIFFERENCES:
        pushes = bank.rows[bank.judge.chosen].predicted_force > 0.0
        for i in range(2):
            if clock.present[i] != 0:
                floor = settings.displacement_noise_floor
                if i == 1:
                    floor = _force_floor(settings, bank)
                reading = clock.measurement[i]
                difference_noise.learn(settings, bank.noise[i], time, reading, broken, floor)
                resolution.learn(bank.resolution[i], reading, broken)
                # A place has no corner where the tool touches.
                inside = pushes or i == 0
                if noise_color.learn(bank.color[i], bank.noise[i], reading, inside) and i == 1:
                    _note_motion(settings, bank)
        follow_noise(bank)
    chosen = bank.rows[bank.judge.chosen]
    if settings.motion_adaptation != 0 and clock.present[0] != 0:
        motion_density.learn(
            bank.motion,
            bank.noise[0],
            time,
            clock.measurement[0],
            broken,
            bank.sensor_noise[0],
            chosen.model_error > 0.0,
        )
    tempering.learn(bank.tool, chosen, clock.elapsed)


@compiled
def _note_motion(settings: Any, bank: Any) -> None:
    """Note what the tool's motion makes of the force where the tissue was felt to resist most.

    What matters of differences of means in a row lies next to the highest frequency that these can
    show, where a tool that moves by x within a time t has a velocity of pi x / t. Of what is faster
    something is left in longer means.
    """
    row, color, noise = bank.rows[bank.judge.chosen], bank.color, bank.noise
    depth = max(bank.tool.deepest, 0.0)
    at_rest = force_at(settings, row, depth, 0.0)
    fastest, frequency = 0.0, 0.0
    for k in range(noise_color.OCTAVES):
        time = noise_color.interval(noise[1], k)
        x = noise_color.deviation_by_motion(color[0], noise[0], time)
        squared_force = math.inf
        if x < math.inf:
            if x * math.pi / time > fastest:
                fastest, frequency = x * math.pi / time, math.pi / time
            deeper = force_at(settings, row, depth + x, 0.0) - at_rest
            faster = force_at(settings, row, depth, frequency * x) - at_rest
            squared_force = deeper * deeper + faster * faster
        color[1].moved[k] = 2.0 ** (k + 1) * squared_force


@compiled
def follow_noise(bank: Any) -> None:
    """Bring bank.sensor_noise up to the differences."""
    first = difference_noise.FIRST_SAMPLES
    noise = bank.noise
    if bank.calibrated == 0:
        known = noise[0].count >= first and noise[1].count >= first
        if not known and bank.clock.accepted < LARGEST_WAIT:
            return
        bank.calibrated = 1
        bank.motion_anew = 1
    for i in range(2):
        if noise[i].count == 0:
            continue
        variance = difference_noise.cautious(noise[i])
        variance *= noise_color.factor(bank.color[i], noise[i])
        variance = max(variance, resolution.variance(bank.resolution[i]))
        latest = difference_noise.latest(noise[i])
        if noise[i].count > first and latest > SUDDEN * variance:
            variance = latest
        bank.sensor_noise[i] = variance
