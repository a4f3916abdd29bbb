"""The files that `hc setup` writes: the estimator's parameters, and a run with it."""

from __future__ import annotations

import math
import shlex
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.robot_streams import Stream
from hc_bringup.terminal.numbers import rounded
from hc_estimator.stream.arrival_clock import ARRIVAL
from hc_estimator.stream.merger import MAXIMUM_WAIT_S, needed_wait_s
from hc_estimator.stream.sensor_setup import SensorProposal, SetupProposal
from hc_estimator.stream.vocabulary import CHANNEL_DELAY
from hc_logger.errors import BagError
from hc_logger.new_file import write_new_text
from hc_msgs_py.ros_yaml import scalar_for_ros

_RUN = """\
# A run with {name}.yaml, written by `hc setup` on {day}: start it with `hc run {run}`.
duration_s: 0.0   # 0: until Ctrl-C

nodes:
  - name: estimator
    module: hc_estimator.node
    parameter_files: [{name}.yaml]
    respawn: true                        # a node that died goes on from what it had learnt
    parameters:
      state.folder: {name}_state         # here, in the folder where hc was started
      expected_estimate_subscribers: 2   # recorder and the live display
  - name: recorder
    module: hc_logger.recorder_node
    parameters:
      topics: ["*"]
      exclude: [/parameter_events, /rosout, /hc/reconstructed_wrench]
      expected_topics: [hc/estimate]
"""

_SI = {"N": "newtons", "mm": "metres"}
"""What the node takes readings for, by the unit in which it tells them."""


def check_free(parameters: Path) -> Path:
    """Return where the run goes beside a parameter file.

    Raises:
        UserError: if one of the two files exists, or their folder does not.
    """
    run = parameters.with_name(f"{parameters.stem}_run.yaml")
    for path in (parameters, run):
        if path.exists():
            raise UserError(f"{path} exists already: choose another name with -o", WRONG_USE)
    if not parameters.parent.is_dir():
        raise UserError(f"there is no folder {parameters.parent}", WRONG_USE)
    return run


def write_files(
    parameters: Path,
    force: Stream,
    position: Stream,
    found: SetupProposal,
    offsets: dict[str, float],
    *,
    simulated: bool = False,
) -> Path:
    """Write both files; returns that of the run.

    Args:
        parameters: where the estimator's parameters go.
        force: the force stream.
        position: the position stream.
        found: how they are to be read.
        offsets: time offsets [s] of "force" and "position"; under CHANNEL_DELAY a delay that is to
            be taken as it is.
        simulated: the sensors are stamped by /clock.

    Raises:
        UserError: if they exist or cannot be written.
    """
    run = check_free(parameters)
    day = date.today().isoformat()
    text = _parameters(parameters.stem, day, force, position, found, offsets, simulated)
    try:
        write_new_text(parameters, [text])
        write_new_text(run, [_RUN.format(name=parameters.stem, run=shlex.quote(str(run)), day=day)])
    except BagError as error:
        raise UserError(str(error)) from error
    return run


def _parameters(
    name: str,
    day: str,
    force: Stream,
    position: Stream,
    found: SetupProposal,
    offsets: dict[str, float],
    simulated: bool,
) -> str:
    peak = float(np.nanmax(np.abs(found.force_n)))
    if force.kind == "effort":
        settings = _of_effort(position, found)
    else:
        settings = _of_sensors(force, position, found, offsets)
    lines = [
        f"# {name}: written by `hc setup` on {day} from {found.time_s[-1]:.0f} s of readings.",
        f"# Force noise {found.force.noise:.2g} N, position noise {found.position.noise:.2g} mm, "
        f"largest force {peak:.3g} N.",
        "# docs/node.md explains every setting; hc doctor looks whether they still fit.",
        "estimator:",
        "  ros__parameters:",
        *(_SIMULATED if simulated else ()),
        _limit(found.force_limit),
        *_deviation(found.position.zero_std),
        *_delay(offsets),
        *(_ONE_MESSAGE if force.kind == "effort" else ()),
        "    input:",
        *settings,
    ]
    lines += [f"# {note}" for note in found.notes]
    return "\n".join(lines) + "\n"


def _limit(force_n: float) -> str:
    """Return the setting that leaves out what is at the end of the sensor's range [N]."""
    if math.isnan(force_n):
        return "    # force_limit: 60.0        # N; set it just below your sensor's range"
    return f"    force_limit: {_number(force_n)}   # N; the sensor's range ends just above"


def _of_sensors(
    force: Stream, position: Stream, found: SetupProposal, offsets: dict[str, float]
) -> list[str]:
    """Return the settings of a force sensor and a position."""
    return [
        "      source: sensors",
        "      force:",
        *_sensor(force, found.force, "N", offsets.get("force", 0.0)),
        *(_of_tool(name, value) for name, value in found.mechanics.items()),
        "      position:",
        f"        type: {position.kind}",
        *_sensor(position, found.position, "mm", offsets.get("position", 0.0)),
        *_pairing(min(found.force.rate_hz, found.position.rate_hz), offsets),
    ]


def _of_tool(name: str, value: float) -> str:
    """Return a setting of what lies between force sensor and tissue."""
    from hc_estimator.ros.node_settings import NODE_SETTINGS

    setting = NODE_SETTINGS[f"input.force.{name}"]
    return f"        {name}: {_number(value)}   # {setting.unit}; between sensor and tissue"


def _pairing(slower_hz: float, offsets: dict[str, float]) -> list[str]:
    """Return how long a reading is to wait for the other sensor, nothing if the default does.

    Args:
        slower_hz: rate of the slower sensor.
        offsets: time offsets [s] of "force" and "position".
    """
    delay_s = offsets.get("force", 0.0) - offsets.get("position", 0.0)
    wait_s = needed_wait_s(delay_s, 1.0 / slower_hz)
    if wait_s <= MAXIMUM_WAIT_S:
        return []
    return [
        "      pairing:",
        f"        maximum_wait: {wait_s:.3f}   # s; the delay and two periods of the slower one",
    ]


def _of_effort(position: Stream, found: SetupProposal) -> list[str]:
    """Return the settings of a joint whose motor's effort takes the place of a force sensor."""
    zero_n = 0.0 if math.isnan(found.force.zero) else rounded(found.force.zero, 4)
    return [
        "      source: effort   # docs/teleoperation.md, on the estimator node",
        "      effort:",
        f"        scale: {_number(found.force.sign * found.position.sign * found.force.scale)}"
        "   # N per unit of effort",
        *(
            f"        {of_effort}: {_number(found.mechanics[name])}   # {unit}"
            if name in found.mechanics
            else f"        # {of_effort}: {usual}   # {unit}"
            for name, of_effort, usual, unit in (
                ("moving_mass", "mass", 0.5, "kg; what the motor moves, and its friction"),
                ("damping", "damping", 0.0, "N s/mm"),
                ("dry_friction", "dry_friction", 0.0, "N"),
            )
        ),
        "      force:",
        f"        zero: {_number(zero_n)}   # N",
        "      position:",
        *_sensor(position, found.position, "mm", 0.0),
    ]


def _number(value: float) -> str:
    """Return a number as YAML reads it back as one with a fraction."""
    text = f"{value:.9g}"
    if "." in text:
        return text
    return text.replace("e", ".0e") if "e" in text else f"{text}.0"


_SIMULATED = ("    use_sim_time: true   # the sensors are stamped by /clock",)
_ONE_MESSAGE = ("    channel_delay: 0.0   # s; both are of one message: none is looked for",)


def _deviation(zero_std: float) -> list[str]:
    if not math.isfinite(zero_std):
        return []
    return [f"    contact_position_std: {zero_std:.2g}   # mm; how well position.zero is known"]


def _delay(offsets: dict[str, float]) -> list[str]:
    if CHANNEL_DELAY not in offsets:
        return []
    delay_s = offsets[CHANNEL_DELAY]
    late = "force" if delay_s > 0.0 else "position"
    return [f"    channel_delay: {_number(delay_s)}   # s; the {late} is late; auto looks for it"]


def _sensor(stream: Stream, found: SensorProposal, unit: str, offset_s: float) -> list[str]:
    lines = [f"        topic: {stream.topic}   # {stream.rate_hz:.0f} Hz"]
    settings: list[tuple[str, Any, str]] = []
    if stream.child:
        settings += [("base_frame", stream.frame, ""), ("child_frame", stream.child, "")]
    else:
        lines[0] += f", frame {stream.frame or '-'}"
    if found.joint:
        settings.append(("joint", found.joint, ""))
    elif found.axis:
        settings.append(("axis", found.axis, ""))
    if found.axis == "direction":
        settings.append(("direction", [round(c, 4) for c in found.direction], ""))
    settings.append(("sign", found.sign, ""))
    if found.scale != 1.0:
        settings.append(("scale", _number(found.scale), f"the readings are no {_SI[unit]}"))
    if math.isnan(found.zero):
        settings.append(("zero", 0.0, f"{unit}; not known yet: hc tare or hc find-surface"))
    else:
        settings.append(("zero", _number(rounded(found.zero, 4)), f"{unit}"))
    if offset_s:
        settings.append(("time_offset", offset_s, "s"))
    if found.held:
        settings.append(("held", "true", f"new readings at {found.rate_hz:.0f} Hz, then repeated"))
    if found.late_s:
        settings.append(
            (
                "stamps",
                ARRIVAL,
                f"read at an even {found.rate_hz:.0f} Hz; stamps up to "
                f"{1e3 * found.late_s:.2g} ms off",
            )
        )
    for name, value, comment in settings:
        if isinstance(value, str) and name not in ("scale", "zero", "held"):
            value = scalar_for_ros(value)
        lines.append(f"        {name}: {value}" + (f"   # {comment}" if comment else ""))
    return lines
