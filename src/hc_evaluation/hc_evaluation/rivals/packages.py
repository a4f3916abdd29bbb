"""The plain unscented filter of `plain_ukf` in Stone Soup and in pykalman, sample by sample.

Both packages are optional (`pip install 'hc-suite[rivals]'`). Stone Soup gives the numbers of
filterpy. pykalman has sigma points of its own (alpha = 1, beta = 0, kappa = 3 - n, drawn once), so
that its numbers are near, not the same.
"""

from __future__ import annotations

import datetime
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from hc_evaluation.rivals.plain_ukf import RATE_HZ, STATES, NotAvailableError, Runner, start

Array = NDArray[np.float64]
EXTRA: Final = "pip install 'hc-suite[rivals]'"


def move(x: Array) -> Array:
    """Return states (7,) or (7, points) one sample later."""
    dt = 1.0 / RATE_HZ
    moved = np.array(x, float)
    moved[0] = x[0] + dt * x[1] + 0.5 * dt * dt * x[2]
    moved[1] = x[1] + dt * x[2]
    return moved


def measure(x: Array) -> Array:
    """Return displacement [mm] and force [N] of states (7,) or (7, points).

    Written out, not `hunt_crossley_force`: what the package costs is measured, without our guards.
    """
    damping = np.exp(x[4]) * np.sign(x[1]) * np.abs(x[1]) ** x[6]
    force = np.maximum(x[0], 0.0) ** x[5] * (np.exp(x[3]) + damping)
    return np.array([x[0], np.maximum(force, 0.0)], float)


def pykalman_runner() -> Runner:
    """Return pykalman's additive unscented filter, fed as a stream.

    Raises:
        NotAvailableError: if pykalman is not installed.
    """
    try:
        from pykalman import AdditiveUnscentedKalmanFilter
    except ImportError as error:
        raise NotAvailableError(f"no pykalman ({EXTRA})") from error
    first, spread, process, noise = start()
    ukf = AdditiveUnscentedKalmanFilter(move, measure, process, noise, first, spread)

    def run(samples: Array) -> Array:
        state, covariance = first, spread
        states = np.empty((len(samples), STATES))
        for number, reading in enumerate(samples):
            state, covariance = ukf.filter_update(state, covariance, reading)
            states[number] = state
        return states

    return run


def stone_soup_runner() -> Runner:
    """Return Stone Soup's unscented predictor and updater, fed as a stream.

    Raises:
        NotAvailableError: if Stone Soup is not installed.
    """
    try:
        from stonesoup.models.measurement.nonlinear import NonLinearGaussianMeasurement
        from stonesoup.models.transition.base import TransitionModel
        from stonesoup.predictor.kalman import UnscentedKalmanPredictor
        from stonesoup.types.array import StateVector, StateVectors
        from stonesoup.types.detection import Detection
        from stonesoup.types.hypothesis import SingleHypothesis
        from stonesoup.types.state import GaussianState
        from stonesoup.updater.kalman import UnscentedKalmanUpdater
    except ImportError as error:
        raise NotAvailableError(f"no Stone Soup ({EXTRA})") from error
    first, spread, process, noise = start()

    class Motion(TransitionModel):  # type: ignore[misc]  # Stone Soup ships no types
        @property
        def ndim_state(self) -> int:
            return STATES

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            return move(np.asarray(state.state_vector, float)).view(StateVectors)

        def covar(self, **_: Any) -> Array:
            return process

        def pdf(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError("the unscented filter asks for no density")

        def rvs(self, *_: Any, **__: Any) -> Any:
            raise NotImplementedError("the unscented filter draws nothing")

    class Sensors(NonLinearGaussianMeasurement):  # type: ignore[misc]
        @property
        def ndim_meas(self) -> int:
            return 2

        def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
            return measure(np.asarray(state.state_vector, float)).view(StateVectors)

    points = {"alpha": 1.0, "beta": 2.0, "kappa": 0.0}
    predictor = UnscentedKalmanPredictor(Motion(), **points)
    sensors = Sensors(STATES, list(range(STATES)), noise)
    updater = UnscentedKalmanUpdater(sensors, **points)
    begin = datetime.datetime(2026, 1, 1, tzinfo=datetime.timezone.utc)
    period = datetime.timedelta(seconds=1.0 / RATE_HZ)

    def run(samples: Array) -> Array:
        state = GaussianState(first, spread, begin)
        states = np.empty((len(samples), STATES))
        for number, reading in enumerate(samples):
            stamp = begin + (number + 1) * period
            prediction = predictor.predict(state, timestamp=stamp)
            detection = Detection(StateVector(reading), timestamp=stamp, measurement_model=sensors)
            state = updater.update(SingleHypothesis(prediction, detection))
            states[number] = np.asarray(state.state_vector, float).ravel()
        return states

    return run
