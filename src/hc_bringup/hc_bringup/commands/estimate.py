"""hc estimate: an estimator over a CSV recording or a bag, without a ROS graph."""

from __future__ import annotations

import argparse
import math
import shlex
import time
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.estimate_table import check_new_table, write_estimates
from hc_bringup.options import each_once, new_file_name
from hc_bringup.standard_input import name_of, typed
from hc_bringup.wrapping import say

HELP = "run an estimator over a recording (CSV or bag) and print the parameters"
COMPILES = True
LEAST_USED_SHARE = 0.02
"""Of the samples: a recording of which less can be used shows nothing of the tissue."""
_MUCH_KNOWN = 0.9
_NOTHING_KNOWN = 0.01
_MUCH_MISFIT = 0.2
"""Of the samples: a law that fits no better is why nothing is known, and no lack of presses."""
_FIGURES = ("force_predicted_rmse_n", "force_reconstructed_rmse_n", "nis_mean")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    recording_input.add_options(parser)
    recording_input.add_filter_options(parser)
    parser.add_argument(
        "-o",
        "--output",
        type=new_file_name,
        metavar="OUT.csv",
        help="write every estimate to a table: .csv, .csv.gz (.bz2, .xz) or .parquet",
    )
    parser.add_argument(
        "--verify",
        action="store_true",
        help="recompute the estimates recorded in a bag and compare every field, bit for bit",
    )
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    import sys

    from hc_bringup.force_error import dishonest_line
    from hc_bringup.reading_changes import change_lines
    from hc_bringup.sensor_effect import doubted_effects
    from hc_bringup.summary import MISFIT_SHARE, to_json, why_unusable
    from hc_bringup.taken_off_live import not_taken_off
    from hc_bringup.unusable import doubts_of
    from hc_estimator.stream.in_pieces import run_in_pieces
    from hc_estimator.stream.readings import MEANINGS

    if arguments.verify:
        return _verify(arguments)
    if arguments.output is not None:
        check_new_table(Path(arguments.output))
    recording = recording_input.load(arguments)
    estimator = make_estimator(arguments, recording)
    changes = recording.reading_changes
    origin_ns = int(recording.stamps[0]) if len(recording.stamps) else 0
    suspicions = doubts_of(recording, estimator.configuration["force_limit"])
    name = name_of(arguments)
    lines = [
        *recording.findings.lines(),
        not_taken_off(recording, arguments),
        *change_lines(changes, origin_ns),
        *(s.sentence for s in suspicions),
    ]
    if changes:
        lines.append(
            "what was read otherwise is no recording of one tissue: hc bag filter --start and "
            "--duration keep one part; what is doubted here is of the last one with a press, and "
            "hc doctor judges the longest one"
        )
    if recording.findings.notes and not recording.is_bag:
        read = (recording.displacement_mm, recording.force_n)
        lines.append(recording_input.assumed_line(*read, table=True))
    meaning = f"what each means and what to do: {MEANINGS}"
    lines += [meaning] * bool(suspicions)
    for line in filter(None, lines):
        print(f"{name}: {line}", file=sys.stderr)
    estimator.warm_up()
    start = time.perf_counter()
    series = run_in_pieces(
        estimator, recording.time_s, recording.displacement_mm, recording.force_n
    )
    seconds = time.perf_counter() - start
    if arguments.output is not None:
        write_estimates(Path(arguments.output), recording, series)
    summary = summarise(estimator, recording, series, seconds)
    for effect in doubted_effects(recording, suspicions, summary):
        suspicions.append(effect)
        print(f"{name}: {effect.sentence}", file=sys.stderr)
        if len(suspicions) == 1:
            print(f"{name}: {meaning}", file=sys.stderr)
    reason = why_no_result(summary, doubted=bool(suspicions))
    if reason:
        raise UserError(f"{name}: {reason}")
    summary["suspicions"] = [
        {"check": s.check.value, "channel": s.channel, "sentence": s.sentence} for s in suspicions
    ]
    if arguments.json:
        print(to_json(summary))
    else:
        say(_text(summary))
    misfit = summary["model_mismatch_share"]
    wrong = why_unusable((s.check.value for s in suspicions), misfit)
    if wrong:
        raise UserError(
            f"{name}: {wrong}: do what stands above them, or see hc doctor "
            f"{shlex.quote(typed(arguments))}"
        )
    if not arguments.json and (line := dishonest_line(summary["nis_mean"])):
        print(f"{name}: {line}", file=sys.stderr)
    if misfit > MISFIT_SHARE:
        print(
            f"{name}: the contact law did not fit in {100 * misfit:.0f} % of the "
            f"samples: hc doctor {shlex.quote(typed(arguments))} says what may be wrong",
            file=sys.stderr,
        )
    return 0


def _verify(arguments: argparse.Namespace) -> int:
    """Compare recorded with recomputed estimates; status 1 if one differs or none compares."""
    import sys

    from hc_bringup.summary import to_json
    from hc_logger.errors import ArrayAloneError, BagError
    from hc_logger.tactile_samples import NOT_VERIFIED
    from hc_logger.verify import verify

    if is_asked_for(arguments):
        raise UserError(
            "--verify takes filter, settings and zeros from the bag: leave the others away",
            WRONG_USE,
        )
    if arguments.output is not None:
        raise UserError("--verify writes no estimates: leave -o away", WRONG_USE)
    try:
        recording = recording_input.load(arguments)
    except UserError as error:
        if isinstance(error.__cause__, ArrayAloneError):
            raise UserError(f"{error}; {NOT_VERIFIED}") from error
        raise
    try:
        report = verify(recording)
    except BagError as error:
        raise UserError(str(error)) from error
    if arguments.json:
        summary = {
            "samples": len(recording.time_s),
            "compared": report.compared,
            "different": report.different,
            "not_comparable": report.not_comparable,
            "notes": [*report.notes, *recording.findings.notes],
        }
        print(to_json(summary))
    else:
        for note in recording.findings.notes:
            print(f"{name_of(arguments)}: {note}", file=sys.stderr)
        print("\n".join(report.lines()))
    return 0 if report.equal else FAILURE


def is_asked_for(arguments: argparse.Namespace) -> bool:
    """Whether options ask for estimates made anew, rather than those recorded."""
    return any(
        (
            arguments.filter,
            arguments.state_space,
            arguments.contact_model,
            arguments.param,
            recording_input.is_given(arguments),
        )
    )


def make_estimator(arguments: argparse.Namespace, recording: Any = None) -> Any:
    """Make the estimator that the options describe.

    Args:
        arguments: parsed options.
        recording: what it is for; how well its contact position was found, and what delay the
            estimator of the bag was told, a filter that considers it is told.

    Raises:
        UserError: if a name or value is wrong; the message says what is allowed.
    """
    from hc_bringup.prepared import prepare
    from hc_estimator import DEFAULT_FILTER, create_estimator
    from hc_estimator.contact.registry import PROBLEMS as LAW_PROBLEMS
    from hc_estimator.filters.registry import PROBLEMS

    choices = {"state_space": arguments.state_space, "contact_model": arguments.contact_model}
    given = {key: value for key, value in choices.items() if value is not None}
    parameters = each_once(arguments.param, "--param")
    clash = sorted(set(given) & set(parameters)) or sorted({"filter"} & set(parameters))
    if clash:
        raise UserError(f"give {clash[0]} as an option of its own, not with --param", WRONG_USE)
    parameters.setdefault("missing_readings", True)
    try:
        estimator = create_estimator(arguments.filter or DEFAULT_FILTER, **given, **parameters)
        if recording is not None:
            prepare(estimator, parameters, recording, arguments)
        return estimator
    except ValueError as error:
        reason = str(error)
        if because := PROBLEMS.get(arguments.filter, ""):
            reason = f"filter {arguments.filter} cannot be used: {because}"
        elif because := LAW_PROBLEMS.get(arguments.contact_model, ""):
            reason = f"contact model {arguments.contact_model} cannot be used: {because}"
        raise UserError(reason, WRONG_USE) from error


def summarise(estimator: Any, recording: Any, series: Any, seconds: float) -> dict[str, Any]:
    """Return what docs/design.md lists for hc estimate --json.

    Force errors and NIS are those of the samples in contact that were used, without the first
    second after the first contact (at most half of what is left from there).
    """
    import numpy as np

    from hc_bringup.force_error import one_step_error, root_mean_square, settled, settling_s
    from hc_bringup.zero_effect import effect_where_exact
    from hc_bringup.zero_words import Zeros
    from hc_estimator import PARAMETER_NAMES, Rejection
    from hc_estimator.stream.together import of_two_readings

    rejected = series.rejected
    used = rejected == 0
    touching = used & series.contact
    counted = np.flatnonzero(settled(recording.time_s, touching))
    force = recording.force_n
    last = series[len(series) - 1]

    def named(values: Any) -> dict[str, float]:
        return dict(zip(PARAMETER_NAMES, map(float, values), strict=True))

    nis = of_two_readings(series.nis, series.innovation)
    effect = effect_where_exact(
        estimator.configuration,
        float(np.nanmax(series.displacement[touching], initial=0.0)),
        last.parameters[2],
        last.parameters_std[2],
        (last.contact_position, last.force_zero),
        (last.parameters[0], last.parameters_std[0]),
    )
    return {
        "samples": len(series),
        "used": int(np.count_nonzero(used)),
        "in_contact": int(np.count_nonzero(touching)),
        "displacements": int(np.count_nonzero(~np.isnan(recording.displacement_mm))),
        "forces": int(np.count_nonzero(~np.isnan(force))),
        "rejected": {
            Rejection(code).name.lower(): int(count)
            for code, count in zip(*np.unique(rejected[~used], return_counts=True), strict=True)
        },
        "filter": estimator.filter,
        "state_space": estimator.state_space,
        "contact_model": estimator.contact_model,
        "parameters": named(last.parameters),
        "parameters_std": named(last.parameters_std),
        "identifiability": named(last.identifiability),
        "most_known": float(np.max(series.identifiability[touching], initial=0.0)),
        "channel_delay": float(last.channel_delay),
        "channel_delay_std": float(last.channel_delay_std),
        **Zeros.in_the_end(touching, lambda k: Zeros.from_estimate(series[k]))._asdict(),
        "stiffness_if_position_off": effect.by_position,
        "stiffness_if_force_zero_off": effect.by_force_zero,
        "changes_detected": int(np.count_nonzero(series.change_detected)),
        "model_mismatch_share": float(np.mean(series.model_mismatch)),
        "settling_s": settling_s(recording.time_s, touching),
        "force_predicted_rmse_n": root_mean_square(
            one_step_error(force, series.force_predicted)[counted]
        ),
        "force_aligned_rmse_n": root_mean_square(series.innovation[counted, 1]),
        "force_reconstructed_rmse_n": root_mean_square(
            (series.force_reconstructed - force)[counted]
        ),
        "nis_mean": float(np.mean(nis[counted])) if len(counted) else float("nan"),
        "microseconds_per_step": 1e6 * seconds / len(series),
    }


def why_no_result(summary: dict[str, Any], *, doubted: bool = False) -> str:
    """Say why a recording gave no parameters, empty if it gave some."""
    count = summary["samples"]
    if summary["used"] < LEAST_USED_SHARE * count:
        rejected = ", ".join(f"{n} {reason}" for reason, n in summary["rejected"].items())
        return f"{summary['used'] or 'none'} of the {count} samples could be used: {rejected}"
    for name, what in (("forces", "force"), ("displacements", "displacement")):
        if not summary[name]:
            return f"there is no {what} in any of the {count} samples"
    if not summary["in_contact"]:
        return (
            f"no contact in {count} samples: displacement counts from the surface, positive into "
            "the tissue, and compression is a positive force (see --find-surface and --input)"
        )
    if not doubted and all(k < _NOTHING_KNOWN for k in summary["identifiability"].values()):
        changes = summary["changes_detected"]
        if changes and summary["most_known"] > _MUCH_KNOWN:
            times = "a change" if changes == 1 else f"{changes} changes"
            return (
                f"{times} of the tissue detected, and what came after the last one shows nothing "
                "of K, B, n and p: press once more behind it; if the tissue stayed as it is, this "
                "filter or contact law does not fit it (-o writes every estimate, with what was "
                "known before)"
            )
        misfit = summary["model_mismatch_share"]
        if misfit > _MUCH_MISFIT:
            return (
                f"the contact law did not fit in {100 * misfit:.0f} % of the samples, and nothing "
                "of K, B, n and p is known in the end: hc doctor says what may be wrong, unless "
                "something rigid lies beneath (then press less deep)"
            )
        return f"the {count} samples show nothing of K, B, n and p: press, and move"
    results = [*summary["parameters"].values(), *summary["parameters_std"].values()]
    results += [summary[name] for name in _FIGURES]
    if not all(map(math.isfinite, results)):
        return f"the numbers are too large to be estimated: {count} samples gave no finite result"
    return ""


def _text(summary: dict[str, Any]) -> str:
    from hc_bringup.summary import (
        aligned_lines,
        delay_lines,
        millinewton,
        parameter_lines,
        zero_lines,
    )

    settling = summary["settling_s"]
    left_out = "second" if settling == 1.0 else f"{settling:.2g} s"
    rejected = ", ".join(f"{n} {reason}" for reason, n in summary["rejected"].items()) or "none"
    return "\n".join(
        [
            f"{summary['filter']} on {summary['state_space']}: {summary['used']} of "
            f"{summary['samples']} samples used, rejected {rejected}; "
            f"{summary['microseconds_per_step']:.1f} us a step",
            *parameter_lines(
                summary["parameters"], summary["parameters_std"], summary["identifiability"]
            ),
            *delay_lines(summary),
            *zero_lines(summary),
            f"after the first {left_out} of contact: force error "
            f"{millinewton(summary['force_predicted_rmse_n'])} one step ahead, "
            f"{millinewton(summary['force_reconstructed_rmse_n'])} after the update; "
            f"mean NIS {summary['nis_mean']:.2f} (ideal 2)",
            *aligned_lines(summary["force_predicted_rmse_n"], summary["force_aligned_rmse_n"]),
            f"changes of the tissue: {summary['changes_detected']}; contact law did not fit in "
            f"{100 * summary['model_mismatch_share']:.0f} % of the samples",
        ]
    )
