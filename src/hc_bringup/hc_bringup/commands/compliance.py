"""hc compliance: what a robot gives way, from presses on something rigid."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup import recording_input
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import positive

HELP = "find what a robot gives way under force, from presses on a block of steel"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser)
    parser.add_argument(
        "--from",
        dest="from_n",
        type=positive,
        metavar="N",
        help="leave out smaller forces (default: a fifth of their range)",
    )
    parser.add_argument("--json", action="store_true", help="print what was found as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command; status 1 where the recording does not show it."""
    from hc_bringup.summary import to_json
    from hc_bringup.wrapping import say
    from hc_estimator.stream.rigid_press import estimate_frame
    from hc_estimator.stream.together import together

    recording_input.check(arguments)
    if recording_input.COMPLIANCE in dict(arguments.sensors):
        raise UserError(
            f"{recording_input.COMPLIANCE} is what is looked for: leave it away", WRONG_USE
        )
    recording = recording_input.load(arguments)
    pairs = together(recording.time_s, recording.displacement_mm, recording.force_n)[1:]
    try:
        found = estimate_frame(*pairs, arguments.from_n)
    except ValueError as error:
        raise UserError(f"{arguments.input}: {error}") from error
    if arguments.json:
        print(to_json(found._asdict()))
    else:
        say(_text(arguments.input, found))
    return 0


def _text(name: str, found: Any) -> str:
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
            f"set it:  hc param set estimator input.{recording_input.COMPLIANCE} {value}",
            f"keep it: frame_compliance: {value} below input: position: of the parameter file",
            f"for a recording: --input {recording_input.COMPLIANCE}={value}",
        )
    )
