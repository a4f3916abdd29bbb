"""Which input the node makes for which `input.source`."""

from __future__ import annotations

from collections.abc import Callable

from hc_estimator.ros.effort import EffortInput
from hc_estimator.ros.inputs import ArrayInput, Input, SampleInput
from hc_estimator.ros.sensors import SensorInput

INPUTS: dict[str, Callable[..., Input]] = {
    "sample": SampleInput,
    "samples": ArrayInput,
    "sensors": SensorInput,
    "effort": EffortInput,
}
"""Each is called with the node, who takes the samples (the same), and the settings' values."""
