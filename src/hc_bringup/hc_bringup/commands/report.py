"""hc report: what a recording says, as one interactive HTML file, or as a picture alone."""

from __future__ import annotations

import argparse
import io
import math
import sys
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.command_words import reading_words
from hc_bringup.commands import estimate
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.standard_input import typed

HELP = "say in words and charts what a recording holds: an HTML page, or a picture"
COMPILES = True
_PICTURES = (".png", ".svg", ".pdf")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser)
    parser.add_argument(
        "-o", "--output", required=True, metavar="OUT", help="page (.html) or .png, .svg, .pdf"
    )
    recording_input.add_filter_options(
        parser, "estimate anew with this filter (default: as recorded)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.run_data import estimated, recorded
    from hc_bringup.standard_input import name_of
    from hc_bringup.unusable import doubts_of, say_unread
    from hc_logger.mixed_estimates import mixture_in
    from hc_logger.new_file import new_file

    target = Path(arguments.output)
    if target.suffix.lower() not in (".html", *_PICTURES):
        raise UserError(f"{target} must end in .html, {', '.join(_PICTURES)}", WRONG_USE)
    if target.exists():
        raise UserError(f"{target} exists already: choose another file", WRONG_USE)
    recording = recording_input.load(arguments)
    say_unread(name_of(arguments), recording)
    data = None if estimate.is_asked_for(arguments) else recorded(recording)
    if data is None:
        if recording.is_bag and (mixture := mixture_in(recording)):
            print(f"{name_of(arguments)}: estimated anew, for {mixture}", file=sys.stderr)
        data = estimated(recording, estimate.make_estimator(arguments, recording))
    doubts = doubts_of(recording, float(data.settings.get("force_limit", math.inf)))
    doubts += _effect(recording, data, doubts)
    for doubt in doubts:
        print(f"{name_of(arguments)}: {doubt.sentence}", file=sys.stderr)
    content = _content(data, doubts, target.suffix.lower(), command_line(arguments))
    try:
        with new_file(target) as file:
            file.write(content)
    except OSError as error:
        raise UserError(f"cannot write {target}: {error.strerror or error}") from error
    print(f"written: {target}")
    return 0


def _effect(recording: Any, data: Any, doubts: list[Any]) -> list[Any]:
    """Return what a sensor made of a channel, if the estimates of a recording are bent by it."""
    import numpy as np

    from hc_bringup.sensor_effect import doubted_effects

    touching = data.contact & data.used
    if not touching.any():
        return []
    last = {name: data.estimates[name][-1] for name in ("channel_delay", "channel_delay_std")}
    share = np.mean(data.model_mismatch[touching])
    return doubted_effects(recording, doubts, last | {"model_mismatch_share": share})


def _content(data: Any, doubts: list[Any], suffix: str, command: list[str]) -> bytes:
    if suffix == ".html":
        from hc_bringup.report.run_page import run_page

        return run_page(data, command, doubts).encode("utf-8", "replace")
    from hc_bringup.picture import draw
    from hc_sim_rig.picture_style import DPI

    picture = io.BytesIO()
    draw(data).savefig(picture, format=suffix.removeprefix("."), dpi=DPI)
    return picture.getvalue()


def command_line(arguments: argparse.Namespace) -> list[str]:
    """Return the command line that makes this report again."""
    words = ["hc", "report", typed(arguments)]
    for name in ("filter", "state_space", "contact_model"):
        if getattr(arguments, name) is not None:
            words += [f"--{name.replace('_', '-')}", getattr(arguments, name)]
    for name, value in arguments.param:
        words += ["--param", f"{name}={value}"]
    return [*words, *reading_words(arguments), "-o", str(arguments.output)]
