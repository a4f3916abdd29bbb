"""What the estimator of a bag took off the samples, and nobody does who reads them.

Zeros of a tare, a compliance and a friction stand in the bag beside samples that are recorded as
they came. Without them K is another than in the run, and nothing else need show it.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hc_bringup.recording_input import OF_A_TABLE, ZEROS
from hc_bringup.robot_mechanics import COMPLIANCE, FRICTION


def taken_off(parameters: Mapping[str, Any]) -> dict[str, float]:
    """Return what an estimator took off samples that are recorded as they came, by setting.

    Args:
        parameters: of its configuration.
    """
    values = {
        name: float(parameters.get(f"input.{name}", 0.0))
        for name in (*ZEROS, COMPLIANCE, *FRICTION)
    }
    return {name: value for name, value in values.items() if value}


def replayed_lines(path: Path, given: Mapping[str, Any], namespace: str = "") -> list[str]:
    """Return what an estimator beside a replay of a bag's samples hears nothing of, a line each.

    Args:
        path: the bag.
        given: settings of that estimator.
        namespace: of the samples that it takes, as /left; empty for those of one arm.

    Raises:
        BagError: if it cannot be read.
    """
    from hc_bringup.reading_changes import change_lines
    from hc_logger.events import events_of, reading_changes
    from hc_logger.foreign import open_bag
    from hc_logger.recorded import configurations_of
    from hc_logger.recording import first_stamp_ns

    with open_bag(path, namespace) as bag:
        changes = reading_changes(events_of(bag) or [])
        configurations = configurations_of(bag)
        begin_ns = first_stamp_ns(bag)
    lines = change_lines(changes, begin_ns)
    if lines:
        lines.append(
            "the samples are played as they were recorded, and the estimator beside them hears "
            "none of that: hc bag filter --start and --duration keep one part"
        )
    found = taken_off(configurations[-1].parameters) if configurations else {}
    settings = [f"{n}={value:.6g}" for n, value in found.items() if f"input.{n}" not in given]
    if settings:
        options = " ".join(f"--param input.{setting}" for setting in settings)
        lines.append(
            f"its estimator took off {', '.join(settings)}: for one that does, say {options}"
        )
    return lines


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
    found = taken_off(recording.configurations[-1].parameters)
    settings = [
        f"{name}={value:.6g}"
        for name, value in found.items()
        if name not in given and not (arguments.find_surface and name in ZEROS)
    ]
    if not settings:
        return ""
    options = " ".join(f"--input {setting}" for setting in settings)
    return f"its estimator took off {', '.join(settings)}: to read it so, say {options}"
