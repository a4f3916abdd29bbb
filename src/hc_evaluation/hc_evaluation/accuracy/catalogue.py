"""The simulated contacts of `hc bench accuracy`: which tissues, motions, rates and noises.

All of them are possible: B is so small beside K that no tool withdraws faster than the tissue
follows. (Before the law was unilateral the same names had two to six times the damping, and up to
38 % of the samples with tension, which no tissue has. Contacts that are lost are in `separation`.)
The first eight tissues were also used (with other seeds) to choose the defaults; the two `unseen`
ones were not looked at before the defaults were fixed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hc_evaluation.accuracy.scenarios import Motion, Scenario, Tissue, log_uniform, without_tension

REFERENCE_MOTION = Motion(3.0, ((1.6, 0.7, 0.0), (0.8, 2.3, 0.5)))
_STIFF_MOTION = Motion(2.5, ((1.2, 0.5, 0.3), (0.6, 1.7, 1.0), (0.25, 4.1, 2.0)))
_SOFT_MOTION = Motion(2.0, ((0.9, 0.4, 0.0), (0.5, 1.1, 1.0), (0.3, 2.7, 2.0)))
_QUICK_MOTION = Motion(1.6, ((0.8, 1.3, 0.0), (0.3, 3.7, 1.0), (0.1, 7.0, 2.0)))
_TAPPING_MOTION = Motion(1.2, ((2.0, 0.8, -1.57), (0.5, 2.9, 0.4)))

REFERENCE_TISSUE = Tissue(0.2, 0.008, 1.8, 1.05)
REFERENCE = Scenario(
    "reference",
    REFERENCE_TISSUE,
    REFERENCE_MOTION,
    1000.0,
    0.002,
    0.010,
    note="scenario of the notes with a sixth of its damping",
)
STIFF = Scenario(
    "stiff", Tissue(1.2, 0.08, 1.9, 0.9), _STIFF_MOTION, 1000.0, 0.002, 0.012, note="stiff, steep"
)
SOFT = Scenario(
    "soft_100hz",
    Tissue(0.05, 0.004, 1.3, 1.0),
    _SOFT_MOTION,
    100.0,
    0.005,
    0.002,
    note="softest, slow sensor",
)
HARD = Scenario(
    "hard_2khz",
    Tissue(5.0, 0.05, 1.1, 1.2),
    _QUICK_MOTION,
    2000.0,
    0.001,
    0.05,
    note="hardest, nearly linear, B/K 0.01",
)
STEEP = Scenario(
    "steep_500hz",
    Tissue(0.4, 0.04, 2.3, 0.8),
    _STIFF_MOTION,
    500.0,
    0.01,
    0.05,
    note="steepest, noise of the recordings",
)
VISCOUS = Scenario(
    "viscous_250hz",
    Tissue(2.0, 0.13, 1.5, 1.1),
    _SOFT_MOTION,
    250.0,
    0.005,
    0.02,
    note="most viscous that the motion allows",
)
TAPPING = Scenario(
    "tapping",
    Tissue(0.8, 0.03, 1.4, 1.0),
    _TAPPING_MOTION,
    1000.0,
    0.003,
    0.015,
    note="contact lost in every period",
)
QUICK = Scenario(
    "quick_200hz",
    Tissue(0.5, 0.028, 1.6, 0.95),
    _QUICK_MOTION,
    200.0,
    0.003,
    0.01,
    note="7 Hz at 200 samples a second",
)
UNSEEN_SOFT = Scenario(
    "unseen_400hz",
    Tissue(0.1, 0.004, 1.35, 1.15),
    Motion(2.2, ((0.7, 0.6, 0.4), (0.5, 1.4, 2.2), (0.3, 2.9, 1.1), (0.1, 4.7, 0.2))),
    400.0,
    0.004,
    0.005,
    note="not used for the defaults",
)
UNSEEN_STIFF = Scenario(
    "unseen_800hz",
    Tissue(3.0, 0.15, 2.0, 0.9),
    Motion(1.8, ((0.9, 0.9, 1.0), (0.4, 2.1, 0.3), (0.2, 3.3, 2.5))),
    800.0,
    0.004,
    0.03,
    note="not used for the defaults",
)

TISSUES = (
    REFERENCE,
    STIFF,
    SOFT,
    HARD,
    STEEP,
    VISCOUS,
    TAPPING,
    QUICK,
    UNSEEN_SOFT,
    UNSEEN_STIFF,
)

CHANGE_AT_S = 5.0


def _changed(scenario: Scenario, tissue: Tissue, name: str) -> Scenario:
    return replace(scenario, name=name, changes=((CHANGE_AT_S, tissue),))


CHANGES = (
    _changed(REFERENCE, Tissue(0.5, 0.02, 1.5, 1.05), "reference_harder"),
    _changed(REFERENCE, Tissue(0.1, 0.005, 2.0, 0.95), "reference_softer"),
    _changed(REFERENCE, Tissue(0.23, 0.008, 1.8, 1.05), "reference_15_percent"),
    _changed(STIFF, Tissue(0.6, 0.03, 1.6, 1.0), "stiff_softer"),
    _changed(HARD, Tissue(2.0, 0.1, 1.4, 1.0), "hard_2khz_softer"),
    _changed(STEEP, Tissue(0.8, 0.06, 1.9, 0.9), "steep_500hz_harder"),
    _changed(SOFT, Tissue(0.1, 0.008, 1.5, 1.0), "soft_100hz_harder"),
    _changed(TAPPING, Tissue(0.4, 0.013, 1.7, 1.1), "tapping_softer"),
)

JUMP_AT_S = 5.0


def _jump(scenario: Scenario, displacement: float, force: float, name: str) -> Scenario:
    return replace(
        scenario,
        name=f"{scenario.name}_{name}",
        noise_jumps=((JUMP_AT_S, displacement, force),),
    )


NOISE_JUMPS = tuple(
    _jump(scenario, displacement, force, name)
    for scenario in (REFERENCE, STIFF, STEEP, TAPPING)
    for displacement, force, name in (
        (1.0, 4.0, "force"),
        (4.0, 1.0, "displacement"),
        (4.0, 4.0, "both"),
    )
)

WEAK_MOTIONS = (
    replace(REFERENCE, name="constant_velocity", motion=Motion(0.5, (), 0.5)),
    replace(REFERENCE, name="hold", motion=Motion(3.0)),
    replace(REFERENCE, name="sine_0.05hz", motion=Motion(3.0, ((1.5, 0.05, 0.0),))),
    replace(REFERENCE, name="sine_0.2hz", motion=Motion(3.0, ((1.5, 0.2, 0.0),))),
    replace(REFERENCE, name="sine_1hz", motion=Motion(3.0, ((1.5, 1.0, 0.0),))),
    replace(REFERENCE, name="free_motion", motion=Motion(-3.0, ((1.5, 1.0, 0.0),))),
    replace(REFERENCE, name="leaves_contact", motion=Motion(5.0, ((1.5, 1.0, 0.0),), -1.2)),
)

CHANNEL_FAULTS = (
    replace(REFERENCE, name="no_fault"),
    replace(REFERENCE, name="force_5ms_late", force_delay_s=0.005),
    replace(REFERENCE, name="force_30ms_late", force_delay_s=0.03),
    replace(REFERENCE, name="contact_0.5mm", contact_position_mm=0.5),
    replace(REFERENCE, name="force_zero_50mn", force_zero_n=0.05),
    replace(STEEP, name="steep_force_30ms_late", force_delay_s=0.03),
    replace(STEEP, name="steep_contact_0.5mm", contact_position_mm=0.5),
    replace(STEEP, name="steep_force_zero_-200mn", force_zero_n=-0.2),
)


def random_scenario(seed: int) -> Scenario:
    """Tissue, motion, rate and noise drawn at random, over the ranges that the suite is made for.

    Stiffness and damping are drawn evenly on a logarithmic scale (the damping is limited to what
    the motion allows without tension); two to four sines keep the tool in contact; the noise of the
    force is 0.1 to 2 % of its largest value.

    Args:
        seed: of the draw.
    """
    draw = np.random.default_rng([seed, 2018])
    stiffness = log_uniform(draw, 0.05, 5.0)
    tissue = Tissue(
        stiffness,
        stiffness * log_uniform(draw, 0.01, 0.5),
        float(draw.uniform(1.1, 2.3)),
        float(draw.uniform(0.8, 1.2)),
    )
    count = int(draw.integers(2, 5))
    frequencies = np.exp(draw.uniform(np.log(0.3), np.log(5.0), count))
    amplitudes = draw.uniform(0.3, 1.0, count) / np.maximum(frequencies, 0.5)
    sines = tuple(
        (float(a), float(f), float(draw.uniform(0.0, 2.0 * np.pi)))
        for a, f in zip(amplitudes, frequencies, strict=True)
    )
    motion = Motion(float(np.sum(amplitudes) + draw.uniform(0.2, 2.0)), sines)
    largest = stiffness * (motion.offset_mm + float(np.sum(amplitudes))) ** (
        tissue.displacement_exponent
    )
    fastest = float(2.0 * np.pi * np.sum(amplitudes * frequencies))
    return Scenario(
        f"random_{seed}",
        without_tension(tissue, fastest),
        motion,
        float(draw.choice([100.0, 200.0, 500.0, 1000.0, 2000.0])),
        log_uniform(draw, 0.001, 0.01),
        largest * log_uniform(draw, 0.001, 0.02),
    )
