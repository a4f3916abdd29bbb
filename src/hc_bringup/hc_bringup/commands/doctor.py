"""hc doctor: what is wrong with a recording or a running set-up, what it costs, what to type."""

from __future__ import annotations

import argparse
import dataclasses
import math
import shlex
from typing import Any

from hc_bringup import heartbeat, recording_input
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.file_preset import CSV_OPTIONS
from hc_bringup.options import positive
from hc_bringup.robot_mechanics import MOTION
from hc_bringup.standard_input import name_of, typed
from hc_bringup.wrapping import say
from hc_msgs_py.topics import NODE_ESTIMATOR

HELP = "verdict on a recording, or on the estimator that runs now"
COMPILES = True
HEARTBEAT = True
LISTEN_S = 10.0
OF_EFFORT = {
    "force.dry_friction": "effort.dry_friction",
    "force.moving_mass": "effort.mass",
    "force.damping": "effort.damping",
}
"""What takes off the force what lies between sensor and tissue, and what it is called of effort."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser, optional=True)
    parser.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help=f"listen so long to a running set-up (default: {LISTEN_S:g})",
    )
    parser.add_argument("--node", metavar="NAME", help="the estimator node (default: estimator)")
    parser.add_argument("--json", action="store_true", help="print the verdict as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; status 1 where something is wrong."""
    from hc_bringup.diagnosis import changes_line, diagnose
    from hc_bringup.finding import Finding
    from hc_bringup.live_check import listen, said_once, too_short_wait
    from hc_bringup.read_otherwise import settings_that_repeat
    from hc_bringup.reading_changes import (
        change_lines,
        judged_line,
        longest_stretch,
        surface_std_at,
    )
    from hc_bringup.taken_off_live import not_taken_off
    from hc_bringup.turn_watch import bag_turning_line
    from hc_estimator.ros.node_settings import OWN_SENSORS
    from hc_logger.errors import BagError

    notes: tuple[str, ...] = ()
    if arguments.input in (None, "live"):
        if recording_input.is_given(arguments):
            raise UserError("--input and --find-surface are for a recording", WRONG_USE)
        recording_input.refuse_csv_options(arguments, "a running node")
        node, seconds = arguments.node or NODE_ESTIMATOR, arguments.seconds or LISTEN_S
        heard = listen(node, seconds)
        findings, notes = list(heard.findings), heard.notes
        rows, settings, type_it = heard.rows, heard.settings, _for_node(node)
        surface_std_mm, force_limit_n = heard.surface_std_mm, heard.force_limit_n
        channel_delay = heard.channel_delay
        from hc_estimator.ros.settings_meaning import counted_once

        once = counted_once({f"input.{name}": value for name, value in settings.items()})
        where = f"node {node}, {seconds:g} s"
    else:
        for name in ("node", "seconds"):
            if getattr(arguments, name) is not None:
                raise UserError(f"--{name} is for a running set-up, not a recording", WRONG_USE)
        heartbeat.doing(f"reading {name_of(arguments)}")
        recording = recording_input.load(arguments)
        reading = recording.findings
        notes = (*reading.being_recorded, *reading.notes, not_taken_off(recording, arguments))
        # Rows with one reading are nothing wrong, nor is a bag that goes on; notes say how it was
        # read.
        wrong = reading._replace(force_alone=0, displacement_alone=0, being_recorded=(), notes=())
        findings = [Finding(line) for line in wrong.lines()]
        # Of sensors that are read along one axis it is among what was read; samples say not how
        # they were made.
        if recording.is_bag and recording_input.reads_samples(arguments):
            try:
                line = bag_turning_line(arguments.input, dict(arguments.sensors))
            except BagError as error:
                raise UserError(str(error)) from error
            if line:
                line = f"unless its samples were read along the surface's normal: {line}"
                notes = (*notes, line)
        rows = (recording.time_s, recording.displacement_mm, recording.force_n)
        surface_std_mm, force_limit_n = recording.surface_std_mm, math.inf
        once = recording.counted_once
        channel_delay = recording_input.known_delay(arguments, recording)
        changes = recording.reading_changes
        if changes:
            stretch = longest_stretch(recording.stamps, recording.time_s, changes)
            time_s, displacement_mm, force_n = (column[stretch.chosen] for column in rows)
            rows = (time_s, displacement_mm, force_n)
            if not recording.contact_position_std_mm:
                end_ns = int(recording.stamps[stretch.chosen][-1])
                surface_std_mm = surface_std_at(recording, end_ns)
            notes = (
                *notes,
                *change_lines(changes, int(recording.stamps[0])),
                judged_line(stretch),
            )
        settings = settings_that_repeat(dict(arguments.sensors), recording)
        type_it = _for_recording(arguments, recording)
        where = f"{name_of(arguments)}, {len(recording.time_s)} samples"
    diagnosis = None
    if rows is not None:
        table = arguments.input not in (None, "live") and not recording.is_bag
        notes = (*notes, recording_input.assumed_line(rows[1], rows[2], table=table))
        heartbeat.doing("estimating, and looking for what is wrong")
        diagnosis = diagnose(*rows, surface_std_mm, force_limit_n, channel_delay, once)
        notes = (*notes, changes_line(diagnosis))
        of_effort = settings.get("source") == "effort"
        findings += [_of_one_message(f) if of_effort else f for f in diagnosis.findings]
        if arguments.input in (None, "live"):
            if settings.get("source") not in OWN_SENSORS:
                findings = [_of_samples(f) for f in findings]
            findings += too_short_wait(rows, settings, findings)
            findings = said_once(findings)
    heartbeat.nothing()
    if arguments.json:
        _print_json(findings, diagnosis, settings, type_it, notes)
    else:
        for note in filter(None, notes):
            say(f"{where.partition(',')[0]}: {note}")
        _print(where, findings, diagnosis, settings, type_it)
    return FAILURE if findings else 0


def _of_one_message(finding: Any) -> Any:
    """Return a finding where force and position come in one message: no stamp of theirs is late.

    Friction there is the joint's own.
    """
    for name, of_effort in OF_EFFORT.items():
        if name in finding.settings:
            others = {n: v for n, v in finding.settings.items() if n == "force.zero"}
            settings = {of_effort: finding.settings[name], **others}
            what = finding.what.replace(name, of_effort)
            return dataclasses.replace(finding, what=what, settings=settings)
    if not any("time_offset" in name or "delay" in name for name in finding.settings):
        return finding
    why = (
        "both are of one message, so that is inertia or friction that the motor also moves "
        "(input.effort.mass, damping, dry_friction), or input.effort.bandwidth"
    )
    return dataclasses.replace(finding, what=f"{finding.what}: {why}", settings={})


def _of_samples(finding: Any) -> Any:
    """Return a finding of a node whose samples another one makes."""
    if finding.settings.keys().isdisjoint(MOTION):
        return finding
    what = f"{finding.what}: of samples that is taken off where they are made"
    return dataclasses.replace(finding, what=what, settings={})


def _for_node(node: str) -> Any:
    """Say how a running node gets settings; returns (those that change, all) -> commands."""
    return lambda changed, _present: [
        f"hc param set {node} {_full(name)} {_word(value)}" for name, value in changed.items()
    ]


def _full(name: str) -> str:
    """Return the node's name of a setting; those below `input.` have a point."""
    return f"input.{name}" if "." in name else name


def _word(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _for_recording(arguments: argparse.Namespace, recording: Any) -> Any:
    """Say how a recording is read with settings; returns (those that change, all) -> commands.

    A command keeps nothing for the next one: each has all settings so far, and what the file's
    columns were said to be.
    """
    words = ["hc", "estimate", typed(arguments)]
    for option in CSV_OPTIONS:
        value = getattr(arguments, option, None)
        if value is not None:
            words += [f"--{option.replace('_', '-')}", str(value)]

    from hc_bringup.diagnosis import CONTACT_STD
    from hc_bringup.treated_samples import FORCE_LIMIT
    from hc_estimator.stream.vocabulary import CHANNEL_DELAY

    of_a_table = (*recording_input.OF_A_TABLE, CONTACT_STD, CHANNEL_DELAY, FORCE_LIMIT)

    def type_it(changed: dict[str, Any], present: dict[str, Any]) -> list[str]:
        usable = {
            name: value for name, value in present.items() if recording.is_bag or name in of_a_table
        }
        lines = []
        if usable.keys() & changed.keys():
            settings = [
                word
                for name, value in usable.items()
                for word in ("--input" if "." in name else "--param", f"{name}={_word(value)}")
            ]
            lines.append(shlex.join(words + settings))
        return lines + [
            f"in the robot's parameter file: {_full(name)}: {_word(value)}"
            for name, value in changed.items()
            if name not in usable
        ]

    return type_it


def apply(present: dict[str, Any], correction: dict[str, Any]) -> dict[str, Any]:
    """Correct the present settings; returns those that change, with their new values.

    Readings are sign x scale x raw - zero, so a factor takes the zero along.

    Args:
        present: settings by name below `input.`; changed in place.
        correction: what the readings made with them are to be multiplied by or shifted by.
    """
    from hc_bringup.terminal.numbers import rounded
    from hc_estimator.stream.vocabulary import CONTACT_POSITION_STD

    changed: dict[str, Any] = {}
    for name, value in correction.items():
        sensor, _point, key = name.partition(".")
        if key in ("", "held", "stamps", "presliding"):  # not added to what was set before
            changed[name] = value
        elif key in ("sign", "scale"):
            changed[name] = type(value)(present.get(name, 1) * value)
            zero = present.get(f"{sensor}.zero", 0.0)
            if zero:
                changed[f"{sensor}.zero"] = rounded(zero * value, 4)
            for taken in OF_EFFORT.keys() & present.keys():
                times = abs(value)
                if sensor == "position":  # of a motion it is so much less, of a force the same
                    times = 1.0 if taken == "force.dry_friction" else 1.0 / times
                changed[taken] = rounded(present[taken] * times, 4)
            if sensor == "position" and CONTACT_POSITION_STD in present:
                deviation_mm = abs(present[CONTACT_POSITION_STD] * value)
                changed[CONTACT_POSITION_STD] = float(f"{deviation_mm:.2g}")
        else:
            changed[name] = rounded(present.get(name, 0.0) + value, 4)
    present.update(changed)
    return changed


def _print(where: str, findings: list[Any], diagnosis: Any, settings: Any, type_it: Any) -> None:
    from hc_bringup.diagnosis import estimate_lines
    from hc_bringup.finding import UNKNOWN
    from hc_estimator.stream.readings import MEANINGS

    number = "nothing is wrong" if not findings else f"{len(findings)} finding(s)"
    say(f"{where}: {number}")
    for i, finding in enumerate(findings, 1):
        say(f"{i}. {finding.what}")
        if finding.cost:
            say(f"   costs: {finding.cost}")
        for command in type_it(apply(settings, finding.settings), settings):
            print(f"   type:  {command}")  # whole, to be copied
    if findings:
        print(f"what each means: {MEANINGS}")
    if diagnosis is not None and diagnosis.estimated is not None:
        uncured = any(finding.cost == UNKNOWN for finding in findings)
        heading = "with what could be put right put right" if findings else "estimated"
        print(f"{heading}{', not to be believed for what could not' * uncured}:")
        say("\n".join(estimate_lines(diagnosis)))


def _print_json(
    findings: list[Any], diagnosis: Any, settings: Any, type_it: Any, notes: tuple[str, ...]
) -> None:
    from hc_bringup.summary import to_json
    from hc_estimator import PARAMETER_NAMES

    estimated = None if diagnosis is None else diagnosis.estimated
    listed = []
    for finding in findings:
        changed = apply(settings, finding.settings)
        listed.append(
            {
                "what": finding.what,
                "cost": finding.cost,
                "settings": {_full(name): value for name, value in changed.items()},
                "type": type_it(changed, settings),
            }
        )
    summary: dict[str, Any] = {
        "findings": listed,
        "notes": [note for note in notes if note],
        "forecasts": [] if diagnosis is None else [f.sentence for f in diagnosis.forecasts],
    }
    if estimated is not None:
        for key, values in (
            ("parameters", estimated.parameters),
            ("parameters_std", estimated.deviations),
            ("identifiability", estimated.identifiability),
        ):
            summary[key] = dict(zip(PARAMETER_NAMES, map(float, values), strict=True))
    print(to_json(summary))
