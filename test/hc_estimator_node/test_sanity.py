"""Readings that cannot be right are doubted, each fault by its own sentence, and no others are."""

import os
import sys
from pathlib import Path

import numpy as np
import pytest

from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream import suspicion_watch
from hc_estimator.stream.readings import Check, usable, whole
from hc_estimator.stream.sanity import _short, check_in_parts, check_samples
from hc_estimator.stream.suspicion_watch import SuspicionWatch

SHARED = Path(os.environ.get("HC_SHARED_DATA", Path(__file__).parents[3] / "shared" / "data"))
RECORDINGS = (
    "palpation_press_triangle",
    "palpation_scan",
    "palpation_sine_hard",
    "palpation_sine_horse_aligned",
    "palpation_sine_horse_raw",
    "palpation_sine_soft",
    "silicone_compression_EF10_50T",
    "silicone_compression_EF50_0T",
    "tissue_ramp_hold_1",
    "tissue_ramp_hold_2",
)


def press(parameters=(0.5, 0.05, 1.5, 1.0), *, rate_hz=500.0, depth=4.0, lift=2.0, seed=0):
    """Ten seconds of presses from free motion into the tissue and back."""
    generator = np.random.default_rng(seed)
    time_s = np.arange(0.0, 10.0, 1.0 / rate_hz)
    swing = 0.5 * (depth + lift)
    displacement = depth - swing + swing * np.sin(3.0 * time_s)
    velocity = 3.0 * swing * np.cos(3.0 * time_s)
    pairs = zip(displacement, velocity, strict=True)
    force = np.array([hunt_crossley_force(d, v, *parameters) if d > 0 else 0.0 for d, v in pairs])
    peak = force.max()
    return (
        time_s,
        displacement + 1e-3 * depth * generator.standard_normal(time_s.size),
        force + 3e-3 * peak * generator.standard_normal(time_s.size),
    )


def checks(*samples):
    return {(s.check, s.channel) for s in check_samples(*samples)}


def hold(values, times):
    return np.repeat(values[::times], times)[: len(values)]


@pytest.mark.parametrize("rate_hz", [100.0, 1000.0])
@pytest.mark.parametrize(
    "parameters",
    [(0.02, 0.001, 2.2, 1.0), (0.5, 0.05, 1.5, 1.0), (5.0, 1.0, 1.1, 0.9), (0.2, 0.3, 1.8, 0.6)],
)
@pytest.mark.parametrize("lift", [0.1, 2.0, 8.0])
def test_presses_into_any_tissue_are_above_suspicion(parameters, rate_hz, lift):
    for seed in range(3):
        assert check_samples(*press(parameters, rate_hz=rate_hz, lift=lift, seed=seed)) == []


def test_noise_free_motion_and_nothing_are_above_suspicion():
    time_s = np.arange(5000) * 1e-3
    noise = np.random.default_rng(1).standard_normal((2, 5000))
    assert check_samples(time_s, -3.0 + 1e-3 * noise[0], 0.02 * noise[1]) == []
    assert check_samples(time_s, -3.0 + np.sin(time_s), 0.02 * noise[1]) == []
    assert check_samples(time_s, -3.0 + np.sin(time_s), np.zeros(5000)) == []
    assert check_samples(time_s[:20], noise[0, :20], noise[1, :20]) == []
    assert check_samples(time_s, np.full(5000, np.nan), noise[1]) == []


@pytest.mark.filterwarnings("error")
def test_readings_beyond_any_sensor_are_passed_over():
    """Regression: their squares overflowed, a warning before the error line."""
    time_s, d, force = press((0.5, 0.05, 1.5, 1.0))
    depth, newtons = d.copy(), force.copy()
    depth[::50], depth[1::50], newtons[2::50] = 1e308, -1e308, 1e200
    assert check_samples(time_s, depth, newtons) == check_samples(time_s, d, force) == []


@pytest.mark.parametrize("name", RECORDINGS)
def test_the_recordings_are_above_suspicion_but_for_what_is_known(name):
    path = SHARED / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"no {path}: set HC_SHARED_DATA")
    found = check_samples(*np.genfromtxt(path, delimiter=",", skip_header=1).T[:3])
    if name == "palpation_press_triangle":  # its README: contact near 6.0 to 6.3 mm
        assert [s.check for s in found] == [Check.POSITION_ZERO]
        assert "contact begins near 6." in found[0].sentence
    else:
        assert found == []


FAULTS = {
    "displacement negated": (lambda t, d, f: (t, -d, f), {(Check.SIGN, "displacement")}),
    "force negated": (lambda t, d, f: (t, d, -f), {(Check.SIGN, "force")}),
    "metres": (lambda t, d, f: (t, d / 1000.0, f), {(Check.UNITS, "displacement")}),
    "micrometres": (lambda t, d, f: (t, d * 1000.0, f), {(Check.UNITS, "displacement")}),
    "millinewtons": (lambda t, d, f: (t, d, f * 1000.0), {(Check.UNITS, "force")}),
    "force zero": (lambda t, d, f: (t, d, f + 1.7), {(Check.FORCE_ZERO, "force")}),
    "force zero below": (lambda t, d, f: (t, d, f - 9.0), {(Check.FORCE_ZERO, "force")}),
    "robot's base": (lambda t, d, f: (t, d + 412.0, f), {(Check.POSITION_ZERO, "displacement")}),
    "too deep": (lambda t, d, f: (t, d - 2.9, f), {(Check.POSITION_ZERO, "displacement")}),
    "too high": (lambda t, d, f: (t, d + 6.0, f), {(Check.POSITION_ZERO, "displacement")}),
    "saturated": (lambda t, d, f: (t, d, np.minimum(f, 2.0)), {(Check.SATURATION, "force")}),
    "saturated amplifier": (
        lambda t, d, f: (t, d, np.minimum(f, 2.0) + 0.004 * np.sin(1e4 * t)),
        {(Check.SATURATION, "force")},
    ),
    "saturated pull": (
        lambda t, d, f: (t, d, np.maximum(-f, -2.0) + 0.004 * np.sin(1e4 * t)),
        {(Check.SATURATION, "force"), (Check.SIGN, "force")},
    ),
    "stamps in milliseconds": (lambda t, d, f: (1e3 * t, d, f), {(Check.TIMES, "displacement")}),
    "stamps in microseconds": (lambda t, d, f: (1e6 * t, d, f), {(Check.TIMES, "displacement")}),
    "coarse force": (lambda t, d, f: (t, d, np.round(f * 5) / 5), {(Check.QUANTISATION, "force")}),
    "coarse position": (
        lambda t, d, f: (t, np.round(d * 4) / 4, f),
        {(Check.QUANTISATION, "displacement")},
    ),
    "dead force": (lambda t, d, f: (t, d, 0.0 * f), {(Check.STUCK, "force")}),
    "dead position": (lambda t, d, f: (t, 0.0 * d + 1.0, f), {(Check.STUCK, "displacement")}),
    "position stops": (
        lambda t, d, f: (t, np.where(t > 6.0, d[3000], d), f),
        {(Check.STUCK, "displacement")},
    ),
    "position stops for a while": (
        lambda t, d, f: (t, np.where((t > 4.0) & (t < 6.0), d[2000], d), f),
        {(Check.PAUSE, "displacement")},
    ),
    "position stops for most of the time": (
        lambda t, d, f: (t, np.where((t > 2.0) & (t < 8.0), d[1000], d), f),
        {(Check.STUCK, "displacement")},
    ),
    "force stops": (
        lambda t, d, f: (t, d, np.where(t > 6.0, f[3000], f)),
        {(Check.STUCK, "force")},
    ),
    "position goes no further": (
        lambda t, d, f: (t, np.minimum(d, 3.0), f),
        {(Check.SATURATION, "displacement")},
    ),
    "pose repeated": (lambda t, d, f: (t, hold(d, 4), f), {(Check.RATE, "displacement")}),
    "force repeated": (lambda t, d, f: (t, d, hold(f, 3)), {(Check.RATE, "force")}),
    "stamps of arrival, next to each other": (
        lambda t, d, f: (hold(t, 10) + 1e-7 * (np.arange(t.size) % 10), d, f),
        {(Check.RATE, "displacement"), (Check.RATE, "force")},
    ),
    "stamps of arrival": (
        lambda t, d, f: (hold(t, 10) + 1e-6 * np.arange(t.size), d, f),
        {(Check.RATE, "displacement"), (Check.RATE, "force")},
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_every_fault_is_doubted_and_nothing_else(fault):
    spoil, expected = FAULTS[fault]
    for seed in range(3):
        assert checks(*spoil(*press(seed=seed))) == expected


def test_sentences_say_what_is_seen_and_what_to_do():
    time_s, displacement, force = press()

    def sentence(*samples):
        (found,) = check_samples(*samples)
        return found.sentence

    assert "turn its sign (force.sign)" in sentence(time_s, displacement, -force)
    metres = sentence(time_s, displacement / 1000.0, force)
    assert "if the displacement were in metres: scale it by 1000 (position.scale)" in metres
    topic = sentence(time_s, displacement * 1000.0, force)  # that tells millimetres for metres
    assert "in micrometres: scale it by 0.001 (position.scale); of a topic that is in mill" in topic
    zero = sentence(time_s, displacement, force + 1.7)
    assert zero.startswith("the force reads 1.7 N free of contact: tare")
    held = sentence(time_s, hold(displacement, 2), force)
    assert "changes only once in 2 samples: it comes at 250 Hz, not at 500 Hz" in held
    assert ", 1/" in sentence(time_s, displacement, np.round(force * 5) / 5)
    assert "come at 0.5 Hz, but would be 500 Hz if the times were in milliseconds" in sentence(
        1e3 * time_s, displacement, force
    )
    called = sentence(1e-3 * time_s, displacement, force)  # Regression: "8333 Hz ... in minutes"
    assert "but would be 500 Hz if the times were in seconds, not in milliseconds" in called
    assert "(--units time=s of a CSV)" in called
    days = sentence(time_s / 86_400.0, displacement, force)
    assert "or 500 Hz if they were in days (time=d)" in days
    assert "force and displacement go down together" in sentence(
        *press(lift=-1.0)[:1], -press(lift=-1.0)[1], -press(lift=-1.0)[2]
    )


def test_a_tool_that_is_held_at_its_deepest_is_above_suspicion():
    """Position exactly constant there, as a controller's encoder tells it; the force relaxes."""
    time_s, displacement, force = press()
    held = (time_s % 2.0944 > 0.4) & (time_s % 2.0944 < 0.7)
    depth = np.where(held, displacement.max(), np.minimum(displacement, displacement.max()))
    falling = np.where(held, force.max() * np.exp(-(time_s % 2.0944)), force)
    assert (Check.SATURATION, "displacement") not in checks(time_s, depth, falling)


def test_a_sign_is_told_from_a_zero_that_is_off_as_well():
    time_s, displacement, force = press()
    (found,) = check_samples(time_s, displacement, 8.4 - force)
    assert (found.check, found.channel) == (Check.SIGN, "force")
    (found,) = check_samples(time_s, 3.0 - displacement, force - 9.0)
    assert (found.check, found.channel) == (Check.SIGN, "displacement")
    (found,) = check_samples(time_s, 8.0 - displacement, 9.0 - force)
    assert (found.check, found.channel) == (Check.SIGN, "both")


def test_a_displacement_that_jumps_is_doubted_and_a_fast_press_or_a_gap_is_not():
    """A tracker that lost its mark for a second left 4e5 N of error, and not a word."""
    time_s, displacement, force = press(rate_hz=125.0)
    jumped = displacement.copy()
    jumped[400:525] -= 500.0
    (found,) = check_samples(time_s, jumped, np.where(jumped < -100.0, 0.0, force))
    assert (found.check, found.channel) == (Check.JUMP, "displacement")
    assert "jumps by 500 mm within 8 ms" in found.sentence
    assert "displacement_limit" in found.sentence

    kept = np.ones(len(time_s), dtype=bool)
    kept[300:380] = False
    fast = np.s_[:: len(time_s) // 250]  # ten seconds in 250 readings: 100 mm/s looks like steps
    for readings in (
        (time_s[kept], displacement[kept], force[kept]),
        (time_s / 20.0, displacement, force),
    ):
        assert (Check.JUMP, "displacement") not in checks(*readings)
    assert (Check.JUMP, "displacement") not in checks(time_s[fast], displacement[fast], force[fast])
    # In micrometres, or with times in milliseconds, it is the unit that is wrong.
    for readings in ((time_s, 1e3 * displacement, force), (1e-3 * time_s, displacement, force)):
        assert (Check.JUMP, "displacement") not in checks(*readings)


def test_a_stream_is_looked_at_between_samples_and_told_once_until_it_is_right():
    watch = SuspicionWatch()
    time_s, displacement, force = press(rate_hz=1000.0)
    stamps = (time_s * 1e9).astype(int).tolist()
    told = []
    clock = 0.0

    def feed(displacements, forces, start):
        nonlocal clock
        for i, (d, f) in enumerate(zip(displacements, forces, strict=True)):
            watch.add(start + stamps[i], float(d), float(f))
            if i % 100 == 0:
                clock += 0.1
                told.extend(watch.look(clock))
            watch.go_on()

    feed(displacement, -force, 0)
    assert [(s.check, s.channel) for s in told] == [(Check.SIGN, "force")]
    assert [s.check for s in watch.suspicions] == [Check.SIGN]
    watch.forget()
    feed(displacement, force, stamps[-1])
    assert len(told) == 1
    assert watch.suspicions == []


def test_a_press_that_shows_too_little_raises_nothing():
    """The first contact of a run lies in the window with much free motion; then it is normal."""
    time_s, displacement, force = press(lift=6.0)
    for end in range(100, 5000, 237):
        assert check_samples(time_s[:end], displacement[:end], force[:end]) == []


def hostile_channel(rng, size):
    """Readings of any kind: still, moving in a part, missing in a part, of any size."""
    kind = rng.integers(6)
    values = np.full(size, rng.choice([0.0, -1.0, 1e11, 5e-324]))
    if kind == 1:
        values = rng.standard_normal(size) * 10.0 ** rng.uniform(-320, 11)
    elif kind == 2:
        values = np.where(np.arange(size) < rng.integers(size), 1.5, np.sin(0.01 * np.arange(size)))
    elif kind == 3:
        values = rng.choice([-1.0, 1.0], size) * 10.0 ** rng.uniform(-300, 11, size)
    elif kind == 4:
        values = np.maximum(0.0, np.sin(0.01 * np.arange(size))) ** 1.5
    elif kind == 5:
        values = np.round(rng.standard_cauchy(size))
    missing = rng.integers(3)
    if missing == 1:
        values[: rng.integers(size)] = np.nan
    elif missing == 2:
        values[rng.random(size) < rng.random()] = np.nan
    return values


@pytest.mark.filterwarnings("error")
def test_nothing_that_comes_in_ends_the_checks():
    """Regression: a channel that stood still where the other one had readings divided by zero."""
    time_s = np.arange(8000) * 1e-3
    moving = np.where(time_s < 4, 1.0 + np.sin(6.0 * time_s), 1.5)
    relaxing = np.where(time_s < 4, np.nan, 1.0 + np.exp(4.0 - time_s))
    assert {s.check for s in check_samples(time_s, moving, relaxing)} == {Check.STUCK}
    rng = np.random.default_rng(4)
    for _ in range(400):
        size = int(rng.choice([1, 99, 150, 600]))
        time_s = np.arange(size) * 10.0 ** rng.uniform(-6, 2)
        if rng.random() < 0.3:
            time_s = rng.choice([rng.permutation(time_s), np.zeros(size), 1e-300 * time_s])
        found = check_samples(time_s, hostile_channel(rng, size), hostile_channel(rng, size))
        assert not any("nan" in s.sentence for s in found)


def test_a_look_is_done_in_small_parts():
    """In one piece it took 14 ms of the thread that has the samples."""
    time_s, displacement, force = press(rate_hz=1000.0)
    parts = check_in_parts(
        usable("displacement", "mm", time_s[:4096], displacement[:4096]),
        usable("force", "N", time_s[:4096], force[:4096]),
    )
    calls = []

    def count(_frame, event, _argument):
        if event == "c_call":
            calls[-1] += 1

    def counted():
        while True:
            calls.append(0)
            sys.setprofile(count)
            try:
                next(parts)
            except StopIteration as end:
                return end.value
            finally:
                sys.setprofile(None)
            yield

    found = whole(counted())
    assert found == check_samples(time_s[:4096], displacement[:4096], force[:4096])
    assert len(calls) > 15
    assert max(calls) < 0.25 * sum(calls)


def test_a_look_that_nobody_goes_on_with_is_finished_all_the_same():
    """Samples that come once a second, or come no more, leave no pause between two of them."""
    watch = SuspicionWatch()
    time_s, displacement, force = press()
    told = []
    for part in range(3):
        for t, d, f in zip(time_s, displacement, -force, strict=True):
            watch.add(round(1e9 * (t + part * (time_s[-1] + 0.01))), float(d), float(f))
        for step in range(21):
            told += watch.look(2.1 * part + 0.1 * step)
    assert [(s.check, s.channel) for s in told] == [(Check.SIGN, "force")]


def test_a_look_that_fails_says_so_and_the_next_one_works(monkeypatch):
    """Regression: an error of these checks, which only advise, ended the estimator node."""
    watch = SuspicionWatch()
    watch.add(0, 1.0, 1.0)

    def fails(*_):
        yield
        raise ZeroDivisionError("of all things")

    with monkeypatch.context() as patched:
        patched.setattr(suspicion_watch, "check_in_parts", fails)
        assert watch.look(0.0) == []
    watch.go_on()
    assert watch.looking
    watch.go_on()
    assert not watch.looking
    assert watch.failure == "ZeroDivisionError: of all things"
    watch.add(1, 1.0, 1.0)
    assert watch.look(10.0) == []
    while watch.looking:
        watch.go_on()
    assert watch.failure == ""


@pytest.mark.parametrize(("value", "text"), [(6.54, "6.5"), (-200.4, "-200"), (0.052, "0.052")])
def test_numbers_of_a_sentence_are_written_without_an_exponent(value, text):
    assert _short(value) == text
