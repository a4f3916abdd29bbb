"""Which recording a command works on, and how its sensors are read: shared by estimate and report.

`--input` takes the names of the estimator node's parameters input.*, so that what one found out on
a recording goes into the node's parameter file as it is.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hc_bringup import file_preset
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import assignment, each_once, natural, positive
from hc_bringup.read_otherwise import (
    check_as_read,
    check_overlap,
    from_surface,
    read_as,
    what_is_allowed,
)
from hc_bringup.real_readings import at_even_times, less_interpolated, less_repeated
from hc_bringup.robot_mechanics import COMPLIANCE, FRICTION, MECHANICS, MOTION, less_mechanics

ZEROS = ("force.zero", "position.zero")
"""What can be said of any recording."""
OF_A_TABLE = (
    *(
        f"{channel}.{name}"
        for channel in ("force", "position")
        for name in ("sign", "scale", "zero", "time_offset", "held", "stamps")
    ),
    *MECHANICS,
)
"""What can be said of a CSV file and of recorded samples as well; the rest is for a bag with two
sensors' topics."""

_TEXT, _NUMBER, _WHOLE = "a word", "a number", "a whole number"
_NUMBERS = "a list of numbers (0.6,0,0.8)"
_FLAG = "true or false"
_SENSOR = {
    "topic": _TEXT,
    "axis": _TEXT,
    "direction": _NUMBERS,
    "sign": _WHOLE,
    "scale": _NUMBER,
    "zero": _NUMBER,
    "time_offset": _NUMBER,
    "held": _FLAG,
    "stamps": _TEXT,
}
_KINDS = {
    "force": _SENSOR | {name.removeprefix("force."): _NUMBER for name in (*FRICTION, *MOTION)},
    "position": _SENSOR
    | {"joint": _TEXT, "child_frame": _TEXT, "base_frame": _TEXT, "frame_compliance": _NUMBER},
    "pairing": dict.fromkeys(("maximum_wait", "reorder_window", "maximum_gap"), _NUMBER),
}
KIND_OF = {f"{group}.{name}": kind for group in _KINDS for name, kind in _KINDS[group].items()}
_IN_SECONDS = ("time_offset", *_KINDS["pairing"])


def add_options(parser: argparse.ArgumentParser, *, optional: bool = False) -> None:
    """Declare the recording, which may be left away if it is optional, and how it is read."""
    parser.add_argument(
        "input",
        nargs="?" if optional else None,
        metavar="INPUT",
        help="CSV file, bag folder or .mcap file; - for what is piped in",
    )
    add_reading_options(parser)


def add_reading_options(parser: argparse.ArgumentParser) -> None:
    """Declare how a recording is read."""
    parser.add_argument(
        "--input",
        dest="sensors",
        type=assignment,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="how the sensors are read, as the node's parameter input.NAME: force.zero (N) and "
        "position.zero (mm), sign, scale, time_offset, held and stamps of either, and "
        "position.frame_compliance (mm/N), force.dry_friction (N) and force.presliding (mm), "
        "force.moving_mass (kg) and force.damping (N s/mm); of a bag with a wrench and a position "
        "topic also force.topic, force.axis, position.joint, pairing.maximum_gap "
        "and so on: with one of these its sensors are read, else its indenter/sample if there",
    )
    parser.add_argument(
        "--preset",
        metavar="NAME",
        help="how a machine writes its files: a YAML with the options below, or one of config "
        "(robots/texture_analyser, robots/bench_indenter); options that are given go before it",
    )
    parser.add_argument(
        "--find-surface",
        action="store_true",
        help="take force zero and contact position from the first approach of the recording",
    )
    add_csv_options(parser)


def add_filter_options(parser: argparse.ArgumentParser, anew: str = "") -> None:
    """Declare the filter and its settings.

    Args:
        parser: to add to.
        anew: help of --filter where estimates may be there already; the others are told beside it.
    """
    for option, metavar, plain, beside in (
        ("--filter", "F", "filter (default: the node's)", anew),
        (
            "--state-space",
            "S",
            "state space (default: kinematic)",
            "the same, with this state space",
        ),
        (
            "--contact-model",
            "M",
            "contact law (default: hunt_crossley)",
            "the same, with this contact law",
        ),
    ):
        parser.add_argument(option, metavar=metavar, help=beside if anew else plain)
    setting = "the same, with this setting" if anew else "a setting of the estimator"
    parser.add_argument(
        "--param",
        type=assignment,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help=f"{setting}; may be given several times",
    )


def add_csv_options(parser: argparse.ArgumentParser) -> None:
    """Declare how a CSV file of somebody else is written; what is left out is found, and said."""
    group = parser.add_argument_group("CSV files of others (what is left out is found, and said)")
    group.add_argument(
        "--columns",
        metavar="NAMES",
        help="time=A,displacement=B,force=C: names of the columns, or numbers from 1",
    )
    group.add_argument(
        "--units",
        metavar="UNITS",
        help="time=s,displacement=mm,force=N: also ms, us, ns, min, d; m, cm, um, nm, in; mN, uN, "
        "nN, kN, gf, kgf, lbf",
    )
    group.add_argument(
        "--separator", metavar="C", help="comma, semicolon, tab, bar or space (or the character)"
    )
    group.add_argument("--decimal", choices=(".", ","), help="decimal sign")
    group.add_argument(
        "--header-lines", type=natural, metavar="N", help="lines before the first row of numbers"
    )
    group.add_argument("--encoding", metavar="NAME", help="utf-8, cp1252, utf-16-le, ...")
    group.add_argument(
        "--rate", type=positive, metavar="HZ", help="rows in a second, of a file without a time"
    )


def csv_options(arguments: argparse.Namespace) -> Any:
    """Return what the options say of a CSV file (hc_logger.csv_options.CsvOptions).

    Raises:
        UserError: if one cannot be.
    """
    from hc_logger.csv_options import CsvOptions, parse_assignments
    from hc_logger.csv_table import SEPARATORS
    from hc_logger.errors import BagError

    given = {}
    for name in ("columns", "units"):
        try:
            text = getattr(arguments, name)
            given[name] = parse_assignments(text) if text is not None else {}
        except ValueError as error:
            raise UserError(f"--{name}: {error}", WRONG_USE) from error
    words = {word: character for character, word in SEPARATORS.items()}
    separator = arguments.separator or ""
    options = CsvOptions(
        columns=given["columns"],
        units=given["units"],
        separator=words.get(separator, "\t" if separator == "\\t" else separator),
        decimal=arguments.decimal or "",
        header_lines=arguments.header_lines,
        encoding=arguments.encoding or "",
        rate_hz=arguments.rate or 0.0,
    )
    try:
        options.check()
    except BagError as error:
        raise UserError(str(error), WRONG_USE) from error
    return options


def refuse_csv_options(arguments: argparse.Namespace, recording: object) -> None:
    """See that nothing is said of how a CSV file is written where there is none.

    Raises:
        UserError: if something is.
    """
    for name in file_preset.CSV_OPTIONS:
        if getattr(arguments, name) is not None:
            option = name.replace("_", "-")
            raise UserError(f"--{option} is for a CSV file, and {recording} is none", WRONG_USE)


def check(arguments: argparse.Namespace) -> None:
    """Check the options that say how a recording is read, before any is.

    Raises:
        UserError: if one is not allowed; the message says why.
    """
    file_preset.apply(arguments)
    csv_options(arguments)
    arguments.sensors = [(name, _listed(name, value)) for name, value in arguments.sensors]
    for name, value in each_once(arguments.sensors, "--input").items():
        if name not in KIND_OF:
            raise UserError(f"--input {name} is none of {', '.join(KIND_OF)}", WRONG_USE)
        if not _is(value, KIND_OF[name]):
            raise UserError(f"--input {name}={value} is not {KIND_OF[name]}", WRONG_USE)
        if allowed := what_is_allowed(name, value):
            raise UserError(f"--input {name}={value} is not {allowed}", WRONG_USE)


def load(arguments: argparse.Namespace, *, one_of_many: bool = False) -> Any:
    """Read the recording that the options name.

    Args:
        arguments: parsed options.
        one_of_many: whether the options are for other recordings too: what they say of CSV files
            is then for those of them that are.

    Returns:
        hc_logger.recorded.Recording, zeros taken off.

    Raises:
        UserError: if it cannot be read, or an option is not allowed; the message says why.
    """
    from hc_bringup.turn_watch import bag_turning_line
    from hc_logger.csv_open import is_text
    from hc_logger.errors import BagError, WrongOptionError
    from hc_logger.recording import has_samples, read_recording

    check(arguments)
    sensors = dict(arguments.sensors)
    mechanics = {name: sensors.pop(name) for name in MECHANICS if name in sensors}
    table = is_text(Path(arguments.input))
    as_read = table  # what stands there is turned and stamped, no sensor's topic is read
    if not (table or one_of_many) and Path(arguments.input).exists():
        refuse_csv_options(arguments, arguments.input)
    for name in sensors:
        if table and name not in OF_A_TABLE:
            raise UserError(
                f"--input {name} is for a bag: of a CSV say {', '.join(OF_A_TABLE)}, and --columns",
                WRONG_USE,
            )
    try:
        if not table and set(sensors) <= set(OF_A_TABLE):
            as_read = has_samples(arguments.input)
        if as_read:
            check_as_read(sensors)
        if as_read or set(sensors) <= set(ZEROS):
            options = csv_options(arguments)
            recording = read_recording(arguments.input, csv_options=options)
            as_it_stands, recording = recording, read_as(recording, sensors)
            check_overlap(as_it_stands, recording, sensors)
            if not getattr(arguments, "verify", False):  # which compares what was estimated then
                recording = at_even_times(recording, sensors)
                recording = less_interpolated(less_repeated(recording, sensors))
        else:
            recording = _read_sensors(arguments.input, sensors)
        axes = not as_read or (not table and recording.is_along_sensor_axes)
        if axes and (line := bag_turning_line(arguments.input, {} if as_read else sensors)):
            found = recording.findings
            found = found._replace(problems=(*found.problems, line))
            recording = dataclasses.replace(recording, findings=found)
        recording = less_mechanics(recording, mechanics, of_samples=as_read)
    except ValueError as error:
        raise UserError(f"--input: {error}", WRONG_USE) from error
    except BagError as error:
        wrong = WRONG_USE if isinstance(error, WrongOptionError) else FAILURE
        raise UserError(str(error), wrong) from error
    return (
        from_surface(recording, mechanics.get(COMPLIANCE, 0.0))
        if arguments.find_surface
        else recording
    )


def reads_samples(arguments: argparse.Namespace) -> bool:
    """Whether of a bag the recorded samples are read, not the topics of its sensors.

    Raises:
        BagError: if it cannot be read.
    """
    from hc_logger.recording import has_samples

    return {name for name, _value in arguments.sensors} <= set(OF_A_TABLE) and has_samples(
        arguments.input
    )


def known_delay(arguments: argparse.Namespace, recording: Any) -> float | str:
    """Return by how much the force is late, as the estimator of a bag was told [s], or "auto"."""
    if any(name.endswith("time_offset") for name, _value in arguments.sensors):
        return "auto"  # with other stamps it is another delay
    found: float | str = recording.channel_delay
    return found


def is_given(arguments: argparse.Namespace) -> bool:
    """Whether the recording is to be read otherwise than as it stands."""
    return bool(arguments.sensors or arguments.find_surface or arguments.preset)


def assumed_line(displacement_mm: Any, force_n: Any, *, table: bool = False) -> str:
    """Say what the readings mean in the units of topics or a table: only a person knows better.

    Centimetres for metres or grams for newtons give figures that soft tissue might have as well.

    Args:
        displacement_mm: penetration [mm], shape (n,); NaN where there is no reading.
        force_n: contact force [N], shape (n,); NaN where there is no reading.
        table: whether they are of a CSV file.
    """
    import numpy as np

    from hc_estimator.stream.readings import robust_range

    places = displacement_mm[np.isfinite(displacement_mm)]
    forces = force_n[np.isfinite(force_n)]
    if not (len(places) and len(forces)):
        return ""
    (low, high), (least, most) = robust_range(places), robust_range(forces)
    does = f"pushes with up to {most:.3g}" if most >= -least else f"pulls with up to {-least:.3g}"
    moves_by = f"the tool moves by {high - low:.3g} mm and {does} N"
    if table:
        return f"read as: {moves_by} (if not: --units displacement=..., force=...)"
    return (
        f"readings taken for metres and newtons: {moves_by} (if not: input.position.scale, "
        "input.force.scale)"
    )


def _listed(name: str, value: Any) -> Any:
    """Return numbers with commas between them, as a shell likes them, as the list that they are."""
    if KIND_OF.get(name) is not _NUMBERS or not isinstance(value, str):
        return value
    try:
        return [float(word) for word in value.split(",")]
    except ValueError:
        return value


def _is(value: Any, kind: str) -> bool:
    if kind is _TEXT:
        return isinstance(value, str)
    if kind is _FLAG:
        return isinstance(value, bool)
    if kind is _NUMBERS:
        return isinstance(value, list) and all(_is(item, _NUMBER) for item in value)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    if kind is _WHOLE and not isinstance(value, int):
        return False
    return abs(value) <= sys.float_info.max  # not of NaN; a whole number may be any size


def _read_sensors(path: str, settings: Mapping[str, Any]) -> Any:
    from hc_logger.sensors import Pairing, Sensor, read_sensors

    groups: dict[str, dict[str, Any]] = {group: {} for group in _KINDS}
    for full_name, value in settings.items():
        group, name = full_name.split(".")
        groups[group][f"{name}_s" if name in _IN_SECONDS else name] = (
            tuple(value) if isinstance(value, list) else value
        )
    return read_sensors(
        path,
        Sensor(**groups["force"]),
        Sensor(**groups["position"]),
        Pairing(**groups["pairing"]),
    )
