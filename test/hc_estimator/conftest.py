"""What the tests of hc_estimator share."""

import fcntl
import json
import tempfile
from pathlib import Path

import numpy as np
import pytest

import hc_estimator as hc
from hc_estimator.compilation import compiled
from hc_estimator.multiple_model import spline, spline_start
from hc_estimator.multiple_model.history import WIDE
from hc_estimator.multiple_model.spline_records import (
    BENDS,
    MOVES,
    RELAXES,
    SINKS,
    STEADY,
    VARIES,
)

SHARED = Path("/work/shared/data")  # real recordings; their licences keep them out of the project


def pytest_collection_finish(session):
    """Compile the default filter before the clock of a first test runs.

    That takes a minute or two where there is no cache yet, about as long as a test may take. Of
    several processes one compiles; the others wait and load. (The stamp in the lock's name: who
    tests other sources on this machine has another cache, and nobody to wait for.)
    """
    here = Path(__file__).parent
    if session.config.option.collectonly or not any(here in i.path.parents for i in session.items):
        return
    name = f"hc_test_compilation_{compiled.stamp[:16]}.lock"
    with (Path(tempfile.gettempdir()) / name).open("a") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        hc.create_estimator("self_tuning_ukf").warm_up()


@pytest.fixture(scope="session")
def recording():
    """Simulates a multi-sine indentation: time [s], displacement [mm], force [N]."""

    def make(
        seconds=1.0,
        rate=1000.0,
        seed=1,
        parameters=(0.2, 0.009, 1.8, 1.05),
        displacement_noise=0.002,
        force_noise=0.01,
        adhesive=False,
    ):
        stiffness, damping, n, p = parameters
        rng = np.random.default_rng(seed)
        time = np.arange(round(seconds * rate)) / rate
        slow, fast = 2 * np.pi * 0.7, 2 * np.pi * 2.3
        d = 3 + 1.6 * np.sin(slow * time) + 0.8 * np.sin(fast * time + 0.5)
        v = 1.6 * slow * np.cos(slow * time) + 0.8 * fast * np.cos(fast * time + 0.5)
        force = d**n * (stiffness + damping * np.sign(v) * np.abs(v) ** p)
        if not adhesive:  # with a damping of 0.045 of the stiffness nothing separates
            force = np.maximum(force, 0.0)
        noise = rng.standard_normal((2, time.size))
        return time, d + displacement_noise * noise[0], force + force_noise * noise[1]

    return make


@pytest.fixture
def check_taps():
    """Checks that after 6 s K of `taps` is within bounds, that the law fits, and calls no change.

    Bounds of the error of ln K: in the median, and at 95 % of the samples 0.02.
    """

    def check(time, series, largest_median):
        settled = time > 6.0
        off = np.abs(np.log(series.parameters[settled, 0] / 0.25))
        assert np.median(off) < largest_median
        assert np.quantile(off, 0.95) < 0.02
        assert np.mean(series.model_mismatch[settled]) < 0.02
        assert not np.any(series.change_detected)

    return check


@pytest.fixture
def taps(plant):
    """Simulates taps of 1.3 Hz on a surface that moves: time [s], displacement [mm], force [N]."""

    def make(seed, surface, force_zero=0.0, phase=0.0):
        draw = np.random.default_rng(seed)
        time = np.arange(0.0, 15.0, 0.002)
        depth = 0.9 + 1.4 * np.sin(8.2 * time + phase) + 0.14 * np.sin(27.0 * time)
        force = plant.force(depth, np.gradient(depth, time), 0.25, 0.004, 1.35, 0.95)
        displacement = depth + surface(time) + 0.0025 * draw.standard_normal(time.size)
        return time, displacement, force + force_zero + 0.002 * draw.standard_normal(time.size)

    return make


@pytest.fixture(scope="session")
def records_of():
    """Gives settings and memory of an estimator, fields as attributes as in compiled code."""

    def views(estimator):
        return tuple(a.view(np.recarray)[0] for a in (estimator._settings, estimator._memory))

    return views


@pytest.fixture
def parts(records_of):
    """Settings and bank of a fresh default filter."""
    return records_of(hc.create_estimator("self_tuning_ukf"))


@pytest.fixture
def filled(records_of):
    """Settings, history and fit of a contact of a kind (`spline_records.py`), its ln K, surface, n.

    400 points 20 ms apart. With zeros the force is 0.05 N and the position 0.3 mm off; what sinks
    does so at 0.04 mm/s; memories take away the shares of the force of `test_spline_fit.py`.
    """

    def law(depth, velocity, log_stiffness, log_ratio, n, p):
        drag = np.exp(log_ratio) * np.sign(velocity) * np.abs(velocity) ** p
        return np.maximum(np.exp(log_stiffness) * np.maximum(depth, 0.0) ** n * (1.0 + drag), 0.0)

    def fill(kind, with_zeros=True):
        settings, bank = records_of(hc.create_estimator("self_tuning_ukf", channel_delay=0.0))
        history, fit = bank.history, bank.fit
        count, shares = 400, np.array([0.0, 0.1, 0.15, 0.05, 0.1])
        time = 0.02 * np.arange(count) + 0.0137  # never quite at rest, where p < 1 has no slope
        slow, quick = 2.0 * np.pi * 1.3, 2.0 * np.pi * 2.9
        depth = 3.0 + np.sin(slow * time) + 0.3 * np.sin(quick * time)
        velocity = slow * np.cos(slow * time) + 0.3 * quick * np.cos(quick * time)
        acceleration = -(slow**2) * np.sin(slow * time) - 0.3 * quick**2 * np.sin(quick * time)
        level, exponent = np.full(count, np.log(0.4)), np.full(count, 1.5)
        surface, speed = np.zeros(count), np.zeros(count)
        if kind & STEADY:
            level += 0.05 * time
        elif kind & VARIES:
            level += 0.4 * np.sin(2.0 * np.pi * time / 6.0)
        if kind & BENDS:
            exponent += 0.1 * np.sin(2.0 * np.pi * time / 7.0)
        if kind & SINKS:
            surface, speed = 0.04 * (time - time[-1]), np.full(count, 0.04)
        if kind & MOVES:
            surface = 0.5 * np.sin(2.0 * np.pi * time / 4.0)
            speed = 0.25 * np.pi * np.cos(2.0 * np.pi * time / 4.0)
        zero, position = (0.05, 0.3) if with_zeros else (0.0, 0.0)
        position = 0.0 if kind & MOVES else position
        history.points[:] = np.zeros((), history.points.dtype)
        history.points[:count]["depth"] = depth + position + surface
        history.points[:count]["force"] = (
            law(depth, velocity, level, np.log(0.02), exponent, 1.0) + zero
        )
        if kind & RELAXES:
            wandering = np.random.default_rng(2).standard_normal((count, shares.size))
            memories = np.cumsum(wandering, axis=0) / 20.0 + 1.0
            history.points[:count]["memory"] = memories
            history.points[:count]["force"] -= memories @ shares
        history.points[:count]["motion_velocity"] = velocity + speed
        history.points[:count]["motion_acceleration"] = acceleration
        history.points[:count]["source"] = WIDE
        history.points[:count]["time"] = time
        history.count, history.first = count, 0
        spline.free_all(settings, fit)
        if not with_zeros:
            fit.held[spline.FORCE_ZERO] = 1
            fit.held[spline.POSITION] = 1
        assert spline.lay_out(history, fit, 0, count, kind)
        bank.rows[0].state[2:6] = np.log(0.6), np.log(0.06), 1.7, 0.9
        spline_start.begin(settings, history, fit, bank.rows[0])
        return settings, history, fit, (level, surface, exponent)

    return fill


class Plant:
    """A tissue, a tool that moves in it, and two sensors. Units: mm, mm/s, N, s."""

    LIVELY = ((1.6, 0.7, 0.0), (0.8, 2.3, 0.5))  # amplitude, frequency, phase
    TAPPING = ((2.5, 1.5, 0.0), (0.3, 5.0, 0.4))

    @staticmethod
    def motion(time, sines=LIVELY, offset=3.0):
        """Displacement and velocity of a sum of sines."""
        d, v = np.full_like(time, offset), np.zeros_like(time)
        for amplitude, frequency, phase in sines:
            rate = 2 * np.pi * frequency
            d += amplitude * np.sin(rate * time + phase)
            v += amplitude * rate * np.cos(rate * time + phase)
        return d, v

    @staticmethod
    def force(d, v, K, B, n, p):
        """Force of the unilateral contact law, without noise."""
        return np.maximum(np.maximum(d, 0.0) ** n * (K + B * np.sign(v) * np.abs(v) ** p), 0.0)

    @staticmethod
    def noisy(d, force, seed, displacement_noise=0.002, force_noise=0.01):
        """Readings of the two sensors."""
        noise = np.random.default_rng(seed).standard_normal((2, d.size))
        return d + displacement_noise * noise[0], force + force_noise * noise[1]


@pytest.fixture(scope="session")
def restored_at():
    """The default filter from sample k on, in an estimator restored from a saved state."""

    def run(k, *columns):
        first, other = (hc.create_estimator("self_tuning_ukf") for _ in range(2))
        first.run(*(column[:k] for column in columns))
        other.restore(json.loads(json.dumps(first.state())))
        return other.run(*(column[k:] for column in columns))

    return run


@pytest.fixture(scope="session")
def plant():
    """The simulated contact, see `Plant`."""
    return Plant


@pytest.fixture(scope="session")
def real():
    """Reads a real recording: time [s], displacement [mm], force [N]; skips where it is absent."""

    def read(name):
        path = SHARED / name
        if not path.exists():
            pytest.skip(f"{path} is not on this machine")
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        return table[:, 0], table[:, 1], table[:, 2]

    return read
