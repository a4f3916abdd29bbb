"""hc setup: finds how a robot's sensors are to be read, writes it down, and starts a run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import positive

HELP = "find how your robot's sensors are to be read, write it down and start a run"
LOOK_S = 1.5
LOOKS = 3
POSITION_KINDS = ("pose", "transform", "joint")
REST_S = 3.0
PRESS_S = 12.0
ONE_GO_S = 15.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("--force", metavar="TOPIC", help="topic of the force sensor")
    parser.add_argument("--position", metavar="TOPIC", help="topic of the tool's position")
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
        help=f"record so long (default: {PRESS_S:g} s of presses, with --yes {ONE_GO_S:g} s)",
    )
    parser.add_argument(
        "--yes",
        action="store_true",
        help="ask nothing: take what is proposed, and record at once while the tool presses",
    )
    parser.add_argument("--no-run", action="store_true", help="start no run in the end")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.robot_files import check_free

    output = Path(arguments.output)
    if output.suffix not in (".yaml", ".yml"):
        output = output.with_name(f"{output.name}.yaml")
    check_free(output)
    if not (arguments.yes or sys.stdin.isatty()):
        raise UserError("there is no terminal to ask at: give --yes", WRONG_USE)
    run_file = _set_up(arguments, output)
    if arguments.no_run:
        print(f"start it with: hc run {run_file}")
        return 0
    if not arguments.yes and not _agrees("start a run with it now?"):
        return 0
    from hc_bringup import cli

    return cli.main(["run", str(run_file)])


def _set_up(arguments: argparse.Namespace, output: Path) -> Path:
    """Find everything out and write the files; returns that of the run."""
    from hc_bringup.diagnosis import assumed_line, diagnose, estimate_lines
    from hc_bringup.graph import Graph
    from hc_bringup.robot_files import write_files
    from hc_bringup.robot_streams import Recorder, best, find_streams
    from hc_estimator.stream.sensor_setup import SetupError, propose

    with Graph() as graph:
        print("looking for sensors ...", flush=True)
        streams = find_streams(graph, LOOK_S)
        for _ in range(LOOKS - 1):  # a driver that has just been started
            if best(streams, ("wrench",)) and best(streams, POSITION_KINDS):
                break
            streams = find_streams(graph, LOOK_S)
        for stream in streams:
            alive = f"{stream.rate_hz:.0f} Hz" if stream.rate_hz > 0.0 else "no message"
            print(f"  {stream.topic} ({stream.kind}): {alive}")
        force = _choose(
            streams,
            arguments.force,
            "force",
            ("wrench",),
            best(streams, ("wrench",)),
            arguments.yes,
        )
        position = _choose(
            streams,
            arguments.position,
            "position",
            POSITION_KINDS,
            best(streams, POSITION_KINDS),
            arguments.yes,
        )
        recorder = Recorder(graph, force, position)
        rest_s = None
        if arguments.yes:
            recorder.start()
            _record(recorder, arguments.seconds or ONE_GO_S, "recording presses")
        else:
            input("Bring the tool to rest free of contact, near the tissue; then press Enter. ")
            recorder.start()
            _record(recorder, REST_S, "let it rest")
            rest_s = recorder.elapsed_s
            print("Now press into the tissue and leave it again, several times, slow and fast.")
            _record(recorder, arguments.seconds or PRESS_S, "press")
        readings = recorder.readings()
    try:
        found = propose(*readings, rest_s=rest_s)
    except SetupError as error:
        raise UserError(str(error), FAILURE) from error
    diagnosis = diagnose(found.time_s, found.displacement_mm, found.force_n)
    corrections: dict[str, Any] = {}
    for finding in diagnosis.findings:
        corrections |= finding.settings
    found = found.corrected(
        corrections.get("force.zero", 0.0), corrections.get("position.zero", 0.0)
    )
    _tell(force, found.force, "N")
    _tell(position, found.position, "mm")
    print(assumed_line(found.displacement_mm, found.force_n))
    for finding in diagnosis.findings:
        if not _are_zeros(finding.settings):  # those are told above
            print(f"{finding.what}{' (allowed for)' if finding.settings else ''}")
    for note in found.notes:
        print(note)
    print("\n".join(estimate_lines(diagnosis)))
    offsets = {
        name: corrections[f"{name}.time_offset"]
        for name in ("force", "position")
        if f"{name}.time_offset" in corrections
    }
    run_file = write_files(output, force, position, found, offsets)
    print(f"written: {output}, {run_file}")
    return run_file


def _choose(
    streams: list[Any],
    given: str | None,
    what: str,
    kinds: tuple[str, ...],
    proposed: Any,
    yes: bool,
) -> Any:
    """Return the stream that the user wants.

    Raises:
        UserError: if there is none, or it sends nothing.
    """
    fitting = [s for s in streams if s.kind in kinds]
    names = ", ".join(s.topic for s in fitting) or "none"
    if given is not None:
        full = given if given.startswith("/") else f"/{given}"
        stream = next((s for s in fitting if s.topic == full), None)
        if stream is None:
            raise UserError(f"there is no {what} topic {full}; there are: {names}", FAILURE)
    elif proposed is None:
        raise UserError(
            f"no {what} topic of type {' or '.join(kinds)} sends anything (there are: {names}): is "
            "the robot's driver running, in this ROS_DOMAIN_ID and on this machine "
            "(ROS_AUTOMATIC_DISCOVERY_RANGE)?",
            FAILURE,
        )
    elif yes or len(fitting) == 1 or _agrees(f"take {proposed.topic} for the {what}?"):
        stream = proposed
    else:
        for i, one in enumerate(fitting, 1):
            print(f"  {i}. {one.topic}")
        answer = input(f"number of the {what} topic: ")
        if not answer.isdigit() or not 1 <= int(answer) <= len(fitting):
            raise UserError(f"{answer!r} is no number from 1 to {len(fitting)}", WRONG_USE)
        stream = fitting[int(answer) - 1]
    if stream.rate_hz == 0.0:
        raise UserError(f"{stream.topic} sends no message: is its driver running?", FAILURE)
    return stream


def _tell(stream: Any, found: Any, unit: str) -> None:
    along = f"joint {found.joint}" if found.joint else f"along {found.axis}"
    if found.axis == "direction":
        along = "along " + ", ".join(f"{c:.2f}" for c in found.direction)
    zero = "zero not known" if found.zero != found.zero else f"zero {found.zero:.4g} {unit}"
    print(
        f"{stream.topic}: {along}, sign {found.sign:+d}, {zero}, noise {found.noise:.2g} {unit}, "
        f"{found.rate_hz:.0f} Hz"
    )


def _are_zeros(settings: dict[str, Any]) -> bool:
    return bool(settings) and all(name.endswith(".zero") for name in settings)


def _agrees(question: str) -> bool:
    return input(f"{question} [Y/n] ").strip().lower() in ("", "y", "yes")


def _record(recorder: Any, seconds: float, what: str) -> None:
    """Record for a while; a terminal shows the seconds that are left, and an empty line after."""
    if not sys.stderr.isatty():
        recorder.spin(seconds, lambda _left: None)
        return
    try:
        recorder.spin(
            seconds,
            lambda left: print(f"\r{what}: {left:3.0f} s ", end="", file=sys.stderr, flush=True),
        )
    finally:
        print("\r\x1b[K", end="", file=sys.stderr, flush=True)
