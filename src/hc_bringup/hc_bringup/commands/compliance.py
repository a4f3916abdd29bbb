"""hc compliance: what a robot gives way, from presses on something rigid, recorded or now."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup import heartbeat, recording_input
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import positive
from hc_bringup.robot_mechanics import COMPLIANCE
from hc_bringup.standard_input import name_of
from hc_msgs_py.topics import NODE_ESTIMATOR

HEARTBEAT = True
LISTEN_S = 30.0
HELP = "find what a robot gives way under force, from presses on a block of steel"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser, optional=True)
    parser.add_argument(
        "--seconds",
        type=positive,
        metavar="S",
        help=f"without INPUT: listen so long to the estimator while you press (default: "
        f"{LISTEN_S:g})",
    )
    parser.add_argument("--node", metavar="NAME", help="the estimator node (default: estimator)")
    parser.add_argument(
        "--from",
        dest="from_n",
        type=positive,
        metavar="N",
        help="leave out smaller forces (default: a fifth of their range)",
    )
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; status 1 where the presses do not show it."""
    from hc_bringup.summary import to_json
    from hc_bringup.wrapping import say
    from hc_estimator.stream.rigid_press import estimate_frame

    node = arguments.node or NODE_ESTIMATOR
    live = arguments.input is None
    displacement_mm, force_n = _heard(arguments, node) if live else _recorded(arguments)
    heartbeat.nothing()
    name = f"node {node}" if live else name_of(arguments)
    try:
        found = estimate_frame(displacement_mm, force_n, arguments.from_n)
    except ValueError as error:
        raise UserError(f"{name}: {error}") from error
    if arguments.json:
        print(to_json(found._asdict()))
    else:
        say(_text(name, node, found))
    return 0


def _recorded(arguments: argparse.Namespace) -> tuple[Any, Any]:
    """Return displacements [mm] and forces [N] of a recording."""
    from hc_estimator.stream.frame_compliance import SETTING
    from hc_logger.errors import BagError

    for option in ("node", "seconds"):
        if getattr(arguments, option) is not None:
            raise UserError(f"--{option} is for a running set-up, not a recording", WRONG_USE)
    recording_input.check(arguments)
    if COMPLIANCE in dict(arguments.sensors):
        raise UserError(f"{COMPLIANCE} is what is looked for: leave it away", WRONG_USE)
    recording = recording_input.load(arguments)
    rows = (recording.time_s, recording.displacement_mm, recording.force_n)
    try:
        known = recording.taken_off_already(SETTING.name)
        return _as_read(rows, known if known and recording_input.reads_samples(arguments) else 0.0)
    except BagError as error:
        raise UserError(str(error)) from error


def _as_read(rows: tuple[Any, Any, Any], mm_per_n: float) -> tuple[Any, Any]:
    """Return displacements from which nothing is taken off, and the forces at their stamps."""
    from hc_estimator.stream.together import together

    _times, displacement_mm, force_n = together(*rows)
    return displacement_mm + mm_per_n * force_n, force_n


def _heard(arguments: argparse.Namespace, node: str) -> tuple[Any, Any]:
    """Return the same of an estimator's samples of now."""
    from hc_bringup.live_check import listen

    if recording_input.is_given(arguments):
        raise UserError("--input and --find-surface are for a recording", WRONG_USE)
    recording_input.refuse_csv_options(arguments, "a running node")
    seconds = arguments.seconds or LISTEN_S
    request = f"press on the steel for {seconds:g} s now: slowly, three times or more"
    heard = listen(node, seconds, request)
    if heard.rows is None:
        raise UserError("; ".join(finding.what for finding in heard.findings), FAILURE)
    return _as_read(heard.rows, heard.settings.get(COMPLIANCE, 0.0))


def _text(name: str, node: str, found: Any) -> str:
    gave_way_mm = found.mm_per_n * (found.to_n - found.from_n)
    value = f"{found.mm_per_n:.4g}"
    if found.loop_mm == found.loop_mm:
        loop = f"the way out {found.loop_mm:+.2g} mm beside the way in"
    else:
        loop = "one way only, which shows no friction and no play: press and let go as slowly"
    return "\n".join(
        (
            f"{name}: {found.ways_in} ways in, {found.ways_out} out, {found.from_n:.3g} to "
            f"{found.to_n:.3g} N; {gave_way_mm:.3g} mm gave way, {loop}",
            f"frame compliance {value} ± {found.mm_per_n_std:.2g} mm/N "
            f"({1.0 / found.mm_per_n:.4g} N/mm), if what was pressed on was rigid",
            f"set it:  hc param set {node} input.{COMPLIANCE} {value}",
            f"keep it: frame_compliance: {value} below input: position: of the parameter file",
            f"for a recording: --input {COMPLIANCE}={value}",
        )
    )
