"""hc setup: finds how a robot's sensors are to be read, writes it down, and starts a run."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from pathlib import Path
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import positive
from hc_bringup.wrapping import say

HELP = "find how your robot's sensors are to be read, write it down and start a run"
COMPILES = True
HEARTBEAT = True
ONE_GO_S = 15.0
EFFORT_PAGE = "docs/teleoperation.md, on the estimator node"
MESSAGES_A_STAMP = 20
"""More of them are not a reading that is repeated until there is a new one."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--force", metavar="TOPIC", help="topic of the force sensor")
    parser.add_argument("--position", metavar="TOPIC", help="topic of the tool's position")
    parser.add_argument(
        "--force-scale",
        type=positive,
        default=1.0,
        metavar="N",
        help="newtons that one of the force reading stands for: volts of a load cell, say",
    )
    parser.add_argument(
        "--position-scale",
        type=positive,
        default=1.0,
        metavar="M",
        help="metres that one of the position reading stands for; signs are found",
    )
    parser.add_argument(
        "-o",
        "--output",
        default="my_robot.yaml",
        metavar="FILE",
        help="parameter file to write; FILE_run.yaml beside it starts a run (default: %(default)s)",
    )
    parser.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help=f"record so long (default: 12 s of presses, with --yes {ONE_GO_S:g} s)",
    )
    parser.add_argument(
        "--yes",
        action="store_true",
        help="ask nothing: take what is proposed, and record at once while the tool presses",
    )
    parser.add_argument("--no-run", action="store_true", help="start no run in the end")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup import cli
    from hc_bringup.robot_files import check_free

    output = Path(arguments.output)
    if output.suffix not in (".yaml", ".yml"):
        output = output.with_name(f"{output.name}.yaml")
    check_free(output)
    if not (arguments.yes or sys.stdin.isatty()):
        raise UserError("there is no terminal to ask at: give --yes", WRONG_USE)
    try:
        run_file = _set_up(arguments, output)
    except UserError:
        raise
    except (KeyboardInterrupt, Exception) as error:
        # Ctrl-C within a callback comes out of the middleware as another error.
        if not (isinstance(error, KeyboardInterrupt) or cli.was_interrupted()):
            raise
        print(file=sys.stderr)  # behind the ^C of the terminal
        raise UserError("ended: nothing was written", cli.interrupted_status()) from None
    say(f"written: {output}, {run_file}")
    if arguments.no_run or not (arguments.yes or _run_now(run_file)):
        say(f"start it with: hc run {shlex.quote(str(run_file))}")
        return 0
    heartbeat.doing("starting the run")
    return cli.main(["run", str(run_file)])


def _run_now(run_file: Path) -> bool:
    """Ask whether the run is to be started; what was written stays where nobody answers."""
    from hc_bringup.asking import Asker, yes_or_no

    heartbeat.nothing()
    try:
        return yes_or_no(Asker(), "start a run with it now?")
    except (KeyboardInterrupt, UserError):
        print()
        return False


def _set_up(arguments: argparse.Namespace, output: Path) -> Path:
    """Find everything out and write the files; returns that of the run."""
    from hc_bringup.graph import Graph
    from hc_bringup.guided_setup import PRESS_S, BackError, Guide, LiveLine, at_once
    from hc_bringup.robot_files import write_files

    tell = LiveLine()
    names = (arguments.force, arguments.position)
    scales = (arguments.force_scale, arguments.position_scale)
    if arguments.yes:
        with Graph() as graph:
            recorded = at_once(graph, *names, arguments.seconds or ONE_GO_S, tell)
        judged = _judge(recorded, scales)
        return write_files(
            *(output, recorded.force, recorded.position, *judged), simulated=recorded.simulated
        )
    from hc_bringup.asking import Asker

    with Graph() as graph:
        guide = Guide(graph, Asker(), tell, arguments.seconds or PRESS_S, scales)
        streams = guide.choose(*names)
        while True:
            try:
                recorded = guide.record(*streams)
                try:
                    judged = _judge(recorded, scales)
                except UserError as error:
                    guide.again(str(error))
                    continue
                if guide.accepts(f"write this to {output}"):
                    return write_files(output, *streams, *judged, simulated=recorded.simulated)
            except BackError:
                streams = guide.choose(None, None)


def _judge(recorded: Any, scales: tuple[float, float]) -> tuple[Any, dict[str, float]]:
    """Say how the sensors are to be read; returns that, and what of `write_files` is late [s].

    Args:
        recorded: what was recorded.
        scales: N and m that one of the readings of force and position stands for.

    Raises:
        UserError: if the readings do not show it.
    """
    from hc_bringup.commands.doctor import apply
    from hc_bringup.diagnosis import diagnose, estimate_lines
    from hc_bringup.guided_setup import FINDING
    from hc_bringup.recording_input import assumed_line
    from hc_bringup.robot_mechanics import FRICTION, MOTION
    from hc_bringup.treated_samples import FORCE_LIMIT
    from hc_bringup.turning import turning_line
    from hc_estimator.stream.repeats import channels_held
    from hc_estimator.stream.sanity import SCALES
    from hc_estimator.stream.sensor_setup import SetupError, propose
    from hc_estimator.stream.vocabulary import CHANNEL_DELAY

    heartbeat.doing(FINDING)
    _check_stamps(recorded)
    try:
        found = propose(*recorded.readings, rest_s=recorded.rest_s).rescaled(*scales)
    except SetupError as error:
        raise UserError(str(error), FAILURE) from error
    known_mm = found.position.zero_std
    diagnosis = diagnose(
        *(found.time_s, found.displacement_mm, found.force_n),
        surface_std_mm=0.0 if math.isnan(known_mm) else known_mm,
        counted_once=channels_held(found.position.held, found.force.held),
    )
    heartbeat.nothing()
    corrections: dict[str, Any] = {}
    for finding in diagnosis.findings:  # each is of readings with those before it put right
        apply(corrections, finding.settings)
    taken_for = assumed_line(found.displacement_mm, found.force_n)
    # The diagnosis put units right before it looked at zeros.
    found = found.rescaled(
        corrections.get("force.scale", 1.0), corrections.get("position.scale", 1.0)
    ).corrected(corrections.get("force.zero", 0.0), corrections.get("position.zero", 0.0))
    if diagnosis.surface_std_mm > 0.0:
        found = found.with_surface_known_to(diagnosis.surface_std_mm)
    _refuse_counts(found)
    if FORCE_LIMIT in corrections:
        found = found._replace(force_limit=corrections[FORCE_LIMIT])
    mechanics = {
        name.removeprefix("force."): corrections[name]
        for name in (*FRICTION, *MOTION)
        if name in corrections
    }
    if mechanics:
        found = found._replace(mechanics=mechanics)
    effort = recorded.force.kind == "effort"
    _tell(recorded.force, found.force, "N")
    _tell(recorded.position, found.position, "mm")
    say(taken_for)
    for finding in diagnosis.findings:
        if not _are_zeros(finding.settings):  # those are told above
            late = any("time_offset" in name or "delay" in name for name in finding.settings)
            allowed = finding.settings and not (effort and late)
            what = finding.what.replace(SCALES, "--force-scale, --position-scale")
            say(f"{what}{' (allowed for)' if allowed else ''}")
            if scaled := [n for n in finding.settings if n.endswith(".scale")]:
                options = " and ".join(f"--{n.replace('.', '-')}" for n in scaled)
                say(
                    f"that unit is a guess, and K is as wrong as it is: of another one, or of a "
                    f"converter's counts, begin again with {options}"
                )
    for note in found.notes:
        say(note)
    if line := _turning_joint(recorded, found.position.joint):
        say(line)
    if line := turning_line(recorded.turned_deg):
        say(line)
    if recorded.simulated:
        say("the sensors are stamped by /clock: use_sim_time: true")
    say("\n".join(estimate_lines(diagnosis)))
    if effort:  # both channels of one message, both through one filter
        say(
            "the force is what the motor pushes, without inertia and friction of what it moves: "
            f"say what you know of them under input.effort in the file written ({EFFORT_PAGE})"
        )
        return found, {}
    offsets = {
        name: corrections[f"{name}.time_offset"]
        for name in ("force", "position")
        if f"{name}.time_offset" in corrections
    }
    if CHANNEL_DELAY in corrections:
        offsets[CHANNEL_DELAY] = corrections[CHANNEL_DELAY]
    return found, offsets


def _check_stamps(recorded: Any) -> None:
    """See that messages say when they were measured.

    Raises:
        UserError: if most have the stamp of another one, or all have none.
    """
    for stream, readings in zip(
        (recorded.force, recorded.position), recorded.readings, strict=False
    ):
        count, different = len(readings.time_s), len(set(readings.time_s.tolist()))
        if count > MESSAGES_A_STAMP * different:
            raise UserError(
                f"{count} messages of {stream.name} have {different} stamp{'s'[: different > 1]}: "
                "when each was measured has to stand in header.stamp, with its nanoseconds (hc "
                f"topic echo {stream.topic} --field header.stamp); its driver has to be mended, "
                "or a node to stamp each as it comes (docs/guide/own_robot.md, readings without a "
                "time)",
                FAILURE,
            )


def _refuse_counts(found: Any) -> None:
    """Refuse zeros that no parameter of a zero takes.

    Raises:
        UserError: if one is beyond: the file written would be refused by the estimator.
    """
    from hc_estimator.ros.node_settings import NODE_SETTINGS

    for name, zero, unit, one in (
        ("force", found.force.zero, "N", "newtons"),
        ("position", found.position.zero, "mm", "metres"),
    ):
        if abs(zero) > NODE_SETTINGS[f"input.{name}.zero"].maximum:
            raise UserError(
                f"the zero of the {name} would be {zero:.3g} {unit}: it does not read {one} but "
                f"counts, say; --{name}-scale takes the {one} that one of them stands for (of a "
                "million counts each: 1e-6), as the sensor's calibration tells",
                FAILURE,
            )


def _turning_joint(recorded: Any, joint: str) -> str:
    """Say of one joint of an arm what it is taken for: JointState tells no unit."""
    if not joint or len(recorded.readings[1].names) < 2:
        return ""
    taken_for, turns, publish = "metres", "radians", "pose"
    if recorded.force.kind == "effort":
        taken_for, turns = "metres and newtons", "radians and newton metres"
        publish = "pose and a WrenchStamped"
    return (
        f"joint {joint} is taken for one that slides ({taken_for}): of one that turns these are "
        f"{turns}, and K, B, n and p mean nothing; then let the arm's driver publish the tool's "
        f"{publish}, or its frames on /tf"
    )


def _tell(stream: Any, found: Any, unit: str) -> None:
    along = f"joint {found.joint}" if found.joint else f"along {found.axis}"
    if found.axis == "direction":
        along = "along " + ", ".join(f"{c:.2f}" for c in found.direction)
    held = (
        f" (of {stream.rate_hz:.0f} messages a second; the others repeat it and are passed over)"
        if found.held
        else ""
    )
    late = (
        f"; stamped on arrival, up to {1e3 * found.late_s:.2g} ms off: read at even times"
        if found.late_s
        else ""
    )
    zero = "zero not known" if found.zero != found.zero else f"zero {found.zero:.4g} {unit}"
    say(
        f"{stream.name}: {along}, sign {found.sign:+d}, {zero}, noise {found.noise:.2g} {unit}, "
        f"{found.rate_hz:.0f} Hz{held}{late}"
    )


def _are_zeros(settings: dict[str, Any]) -> bool:
    return bool(settings) and all(name.endswith(".zero") for name in settings)
