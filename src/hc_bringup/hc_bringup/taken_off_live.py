"""What the estimator of a bag took off the samples, and nobody does who reads them.

Zeros of a tare, a compliance and a friction stand in the bag beside samples that are recorded as
they came. Without them K is another than in the run, and nothing else need show it.
"""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup.recording_input import OF_A_TABLE, ZEROS
from hc_bringup.robot_mechanics import COMPLIANCE, FRICTION


def not_taken_off(recording: Any, arguments: argparse.Namespace) -> str:
    """Say what the estimator of a bag took off in the end, and the options do not.

    Args:
        recording: hc_logger.recorded.Recording.
        arguments: options by which it was read (hc_bringup.recording_input).

    Returns:
        One line; nothing where nothing was taken off, or all of it is.

    Raises:
        BagError: if the bag has several topics of configurations.
    """
    given = dict(arguments.sensors)
    if not (recording.is_bag and recording.configurations and set(given) <= set(OF_A_TABLE)):
        return ""  # of its sensors, where these are named, all is said by the options
    parameters = recording.configurations[-1].parameters
    settings = []
    for name in (*ZEROS, COMPLIANCE, *FRICTION):
        value = float(parameters.get(f"input.{name}", 0.0))
        if value and name not in given and not (arguments.find_surface and name in ZEROS):
            settings.append(f"{name}={value:.6g}")
    if not settings:
        return ""
    options = " ".join(f"--input {setting}" for setting in settings)
    return f"its estimator took off {', '.join(settings)}: to read it so, say {options}"
