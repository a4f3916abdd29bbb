"""Estimators of one's own under the same experiments: anything with run(time, d, F).

What is tried out need not be a filter of hc_estimator. A candidate is an importable function (or
class) that makes an object with `run(time_s, displacement_mm, force_n)`; what that returns needs
`parameters`, shape (N, 4), and whatever else it has of the fields of hc_estimator.EstimateSeries.
What it lacks is filled in here: NaN for numbers, nothing said for flags.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

NUMBERS = (
    "nis",
    "force_predicted",
    "force_noise_std",
    "channel_delay_std",
    "contact_position_std",
    "force_zero_std",
)
ZEROS = ("channel_delay", "contact_position", "force_zero", "hypothesis")
FLAGS = ("change_detected", "model_mismatch")


class Runner(Protocol):
    """What the experiments use of an estimator."""

    def run(self, time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray) -> Any:
        """The series of estimates."""
        ...


class Series:
    """A candidate's answer with all the fields that the experiments read."""

    def __init__(self, answer: Any) -> None:
        """Take over what is there and fill in the rest."""
        self.parameters = np.asarray(answer.parameters, dtype=np.float64)
        count = self.parameters.shape[0]

        def given(name: str, default: Any) -> Any:
            value = getattr(answer, name, None)
            return default if value is None else np.asarray(value)

        self.covariance = given("covariance", np.full((count, 4, 4), np.nan))
        variance = np.diagonal(self.covariance, axis1=1, axis2=2)
        self.parameters_std = given("parameters_std", np.sqrt(np.maximum(variance, 0.0)))
        self.identifiability = given("identifiability", np.full((count, 4), np.nan))
        for name in NUMBERS:
            setattr(self, name, given(name, np.full(count, np.nan)))
        for name in ZEROS:
            setattr(self, name, given(name, np.zeros(count)))
        for name in FLAGS:
            setattr(self, name, given(name, np.zeros(count)).astype(np.bool_))


class Candidate:
    """An estimator that is not one of hc_estimator's."""

    def __init__(self, inner: Runner) -> None:
        """Wrap what the candidate's function made."""
        self._inner = inner

    def run(self, time_s: FloatArray, displacement_mm: FloatArray, force_n: FloatArray) -> Series:
        """The candidate's estimates."""
        return Series(self._inner.run(time_s, displacement_mm, force_n))


def load_candidate(place: str, parameters: Mapping[str, Any]) -> Candidate:
    """Make a candidate.

    Args:
        place: "FILE.py:NAME" or "MODULE:NAME" of the function that makes it.
        parameters: keyword arguments of that function.

    Raises:
        ValueError: there is no such function.
    """
    source, _, name = place.rpartition(":")
    try:
        if source.endswith(".py"):
            path = Path(source).resolve()
            specification = importlib.util.spec_from_file_location(path.stem, path)
            if specification is None or specification.loader is None:
                raise ValueError(f"candidate {place!r}: cannot load {path}")
            module = importlib.util.module_from_spec(specification)
            specification.loader.exec_module(module)
        else:
            module = importlib.import_module(source)
        make = getattr(module, name)
    except (OSError, ImportError, AttributeError) as error:
        raise ValueError(
            f"candidate {place!r} is not FILE.py:NAME or MODULE:NAME: {error}"
        ) from error
    return Candidate(make(**parameters))
