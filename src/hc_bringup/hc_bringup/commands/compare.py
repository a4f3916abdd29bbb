"""hc compare: recordings through several filters or settings, on one page."""

from __future__ import annotations

import argparse
import shlex
import sys
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.command_words import reading_words
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import assignment, each_once

HELP = "run recordings through several filters or settings and compare them on one page"
COMPILES = True
MOST_VARIANTS = 16


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "inputs", nargs="+", metavar="INPUT", help="CSV files, bag folders or .mcap files"
    )
    parser.add_argument(
        "--filter",
        dest="filters",
        action="append",
        default=[],
        metavar="F",
        help="a filter, with its defaults; may be given several times",
    )
    parser.add_argument(
        "--with",
        dest="variants",
        action="append",
        default=[],
        metavar='"F NAME=VALUE ..."',
        help="a filter with settings, state_space and contact_model among them; may be given "
        "several times",
    )
    parser.add_argument(
        "--param",
        type=assignment,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="a setting for all of them; may be given several times",
    )
    parser.add_argument(
        "--recorded", action="store_true", help="compare with the estimates recorded in a bag too"
    )
    recording_input.add_reading_options(parser)
    parser.add_argument("-o", "--output", required=True, metavar="PAGE.html", help="the page")
    parser.add_argument("--json", action="store_true", help="print the scores as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.prepared import prepare
    from hc_bringup.progress import status_line
    from hc_bringup.report.comparison import compare
    from hc_bringup.report.comparison_page import comparison_page
    from hc_bringup.unusable import say_unusable
    from hc_logger.new_file import new_file

    target = Path(arguments.output)
    if target.suffix.lower() != ".html":
        raise UserError(f"{target} must end in .html", WRONG_USE)
    if target.exists():
        raise UserError(f"{target} exists already: choose another file", WRONG_USE)
    variants = _variants(arguments)
    recordings = _recordings(arguments)
    wrong = {
        path: why
        for path, recording in zip(arguments.inputs, recordings, strict=True)
        if (why := say_unusable(path, recording))
    }
    with status_line() as say:
        table = compare(
            recordings,
            variants,
            lambda done, number, what: say(f"{done} of {number}: {what}"),
            lambda estimator, given, recording: prepare(estimator, given, recording, arguments),
        )
    if arguments.recorded:
        _say_not_recorded(arguments.inputs, table)
    try:
        with new_file(target) as file:
            page = comparison_page(table, _command_line(arguments))
            file.write(page.encode("utf-8", "replace"))
    except OSError as error:
        raise UserError(f"cannot write {target}: {error.strerror or error}") from error
    _tell(table, recordings, target, as_json=arguments.json)
    if wrong:
        said = "; ".join(f"{path}: {why}" for path, why in wrong.items())
        raise UserError(f"{said}: do what stands above")
    return 0


def _say_not_recorded(inputs: list[str], table: list[list[Any]]) -> None:
    """Say which recordings hold no estimates to compare with.

    Raises:
        UserError: if nothing is left to compare.
    """
    without = [
        str(path)
        for path, entries in zip(inputs, table, strict=True)
        if all(entry.variant.filter for entry in entries)
    ]
    if not without:
        return
    hold = "holds" if len(without) == 1 else "hold"
    said = f"{', '.join(without)} {hold} no recorded estimates (a bag of hc run does)"
    if sum(map(len, table)) < 2:
        raise UserError(
            f"{said}, and that leaves nothing to compare: name filters with --filter", WRONG_USE
        )
    print(f"hc compare: {said}: --recorded shows nothing of it", file=sys.stderr)


def _recordings(arguments: argparse.Namespace) -> list[Any]:
    """Return the recordings, each read as the options say.

    Raises:
        UserError: if one cannot be read, or an option is not allowed.
    """
    recording_input.check(arguments)
    if arguments.recorded and recording_input.is_given(arguments):
        raise UserError(
            "--recorded takes the estimates of the readings as they were recorded: leave it away, "
            "or --input and --find-surface",
            WRONG_USE,
        )
    several = len(arguments.inputs) > 1
    recordings = []
    for path in arguments.inputs:
        one = argparse.Namespace(**vars(arguments), input=path)
        try:
            recordings.append(recording_input.load(one, one_of_many=several))
        except OSError as error:
            raise UserError(f"{path}: {error.strerror or error}") from error
    return recordings


def _variants(arguments: argparse.Namespace) -> list[Any]:
    """Return the variants that the options name, each of them possible.

    Raises:
        UserError: if there are not at least two ways to look at something, or one cannot be.
    """
    from hc_bringup.report.comparison import Variant

    common = each_once(arguments.param, "--param")
    variants = [Variant(name, name, common) for name in arguments.filters]
    for text in arguments.variants:
        try:
            name, *words = shlex.split(text) or [""]
            own = each_once(map(assignment, words), f"--with {text!r}:")
        except (ValueError, argparse.ArgumentTypeError) as error:
            raise UserError(f"--with {text!r}: {error}", WRONG_USE) from error
        if not name or "=" in name or "filter" in own:
            raise UserError(f"--with {text!r}: give a filter, then NAME=VALUE ...", WRONG_USE)
        variants.append(Variant(" ".join((name, *words)), name, common | own))
    if arguments.recorded:
        variants.append(Variant("recorded", "", {}))
    if len(variants) <= MOST_VARIANTS:
        _check_possible(variants)  # of a name that is misspelt that is to be said, not the number
    if len(variants) < 2 and len(arguments.inputs) < 2:
        raise UserError(
            "give at least two filters or settings to compare, with --filter", WRONG_USE
        )
    if not variants:
        raise UserError("give the filters to compare, with --filter", WRONG_USE)
    if len(variants) > MOST_VARIANTS:
        raise UserError(f"{len(variants)} are too many to tell apart: {MOST_VARIANTS} at most")
    labels = [variant.label for variant in variants]
    for label in labels:
        if labels.count(label) > 1:
            raise UserError(f"{label} is given twice", WRONG_USE)
    return variants


def _check_possible(variants: list[Any]) -> None:
    """See that each variant can be made.

    Raises:
        UserError: if one cannot.
    """
    for variant in variants:
        if not variant.filter:
            continue
        try:
            variant.make()
        except ValueError as error:
            raise UserError(f"{variant.label}: {error}", WRONG_USE) from error


def _command_line(arguments: argparse.Namespace) -> list[str]:
    words = ["hc", "compare", *map(str, arguments.inputs)]
    for name in arguments.filters:
        words += ["--filter", name]
    for text in arguments.variants:
        words += ["--with", text]
    for name, value in arguments.param:
        words += ["--param", f"{name}={value}"]
    if arguments.recorded:
        words.append("--recorded")
    return [*words, *reading_words(arguments), "-o", str(arguments.output)]


def _tell(table: Any, read: list[Any], target: Path, *, as_json: bool) -> None:
    """Print how each recording was read, what compares how, and where the page is."""
    from hc_bringup.report.comparison_page import winners
    from hc_bringup.summary import to_json

    if as_json:
        recordings = [
            {
                "recording": entries[0].data.name,
                "findings": recording.findings.lines(),
                "scores": {e.variant.label: _plain(e.scores) for e in entries},
            }
            for entries, recording in zip(table, read, strict=True)
            if entries
        ]
        print(to_json({"recordings": recordings, "written": str(target)}))
        return
    for entries, recording in zip(table, read, strict=True):
        if entries:
            for line in recording.findings.lines():
                print(f"{entries[0].data.name}: {line}")
            print(f"{entries[0].data.name}: {' '.join(winners(entries))}".rstrip(": "))
    print(f"written: {target}")
    sys.stdout.flush()


def _plain(scores: Any) -> dict[str, Any]:
    import dataclasses

    values = dataclasses.asdict(scores)
    return {key: v.tolist() if hasattr(v, "tolist") else v for key, v in values.items()}
