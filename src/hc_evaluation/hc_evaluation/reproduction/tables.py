"""The tables of the page in Markdown: summary, one table per experiment, and the quick section."""

from __future__ import annotations

import math
from collections.abc import Sequence

from hc_evaluation.reproduction.campaign import QUICK_SEEDS, ExperimentResult
from hc_evaluation.reproduction.experiment import Column, Experiment, load_experiment
from hc_evaluation.reproduction.intervals import Summary
from hc_evaluation.reproduction.ours import ours
from hc_evaluation.reproduction.published import published_value, unit_of
from hc_evaluation.reproduction.verdict import FAILS, Comparison, compare, summary_of

PAGES = "evidence/reproduction"  # of the experiments, from the folder of the page of all
QUICK_BEGIN = "<!-- quick: begin -->"
QUICK_END = "<!-- quick: end -->"

# Rows of every table: score, its heading, and how it is printed.
FORCE = "force"  # in the table's unit
SHARE = "share"  # in percent
PLAIN = "plain"
SECONDS = "s"
ROWS = (
    ("force_mean", "force error as reported, mean", FORCE),
    ("force_max", "force error as reported, largest", FORCE),
    ("force_rmse", "force error as reported, RMSE", FORCE),
    ("law_rmse", "contact law at motion and parameters, RMSE", FORCE),
    ("noise_rmse", "noise estimate, RMSE [N]", PLAIN),
    ("noise_rmse_after", "noise estimate, RMSE later [N]", PLAIN),
    ("noise_mean_error_after", "noise estimate, mean error later [N]", PLAIN),
    ("change_delay_s", "delay of the detected change", SECONDS),
    ("false_changes", "false changes", PLAIN),
    ("position_mean", "position error, mean [cm]", PLAIN),
    ("velocity_mean", "velocity error, mean [cm/s]", PLAIN),
    ("tele_force_mean", "force error, mean [N]", PLAIN),
    ("position_tracking_mean", "position tracking, mean [cm]", PLAIN),
    ("impedance_tracking_mean", "impedance tracking, mean [N]", PLAIN),
    ("position_root_sum", "position error, root of sum [cm]", PLAIN),
    ("velocity_root_sum", "velocity error, root of sum [cm/s]", PLAIN),
    ("tele_force_root_sum", "force error, root of sum [N]", PLAIN),
    ("position_tracking_root_sum", "position tracking, root of sum [cm]", PLAIN),
    ("impedance_tracking_root_sum", "impedance tracking, root of sum [N]", PLAIN),
)
HONEST_ROWS = (
    ("force_late_rmse", "force error as reported, RMSE in the second half", FORCE),
    ("force_from_parameters_rmse", "law at parameters and true motion, second half", FORCE),
    ("one_step_rmse", "one step ahead, RMSE", FORCE),
    ("hold_forward_rmse", "hold-forward, RMSE", FORCE),
    ("error_apparent", "error of K + B v^p at the end", SHARE),
    ("error_K", "error of K at the end", SHARE),
    ("error_B", "error of B at the end", SHARE),
    ("error_n", "error of n at the end", SHARE),
    ("error_p", "error of p at the end", SHARE),
    ("nees", "NEES per free parameter (ideal near 1)", PLAIN),
    ("nis", "NIS (ideal 2)", PLAIN),
    ("updates_undone", "updates undone", PLAIN),
    ("exponents_limited", "samples with an exponent limited in the law", SHARE),
)
LOST = 1e3  # a relative error beyond which an estimate says nothing
LARGEST = 1e9  # what is larger is told in a word
# Scores that are about the noise jump, which only this experiment asks for.
CHANGE_ROWS = ("change_delay_s", "false_changes")


def number(value: float) -> str:
    """Three significant digits; an infinite or absurdly large value in a word."""
    if math.isnan(value):
        return "–"
    if abs(value) >= LARGEST:
        return "diverges"
    if abs(value) >= 1e5:
        return f"{value:.1e}"
    if value != 0.0 and abs(value) < 1e-3:
        return f"{value:.2e}"
    return f"{value:#.3g}".rstrip(".") if abs(value) < 1000 else f"{value:.0f}"


def _scaled(value: float, kind: str, scale: float) -> str:
    if kind == FORCE:
        return number(value * scale)
    if kind == SHARE:
        return number(100.0 * value)
    return number(value)


def cell(summary: Summary, kind: str, scale: float) -> str:
    """Median with its interval, then the mean with its own, as one cell."""
    if summary.count == 0:
        return "–"

    def text(value: float) -> str:
        return _scaled(value, kind, scale)

    median = text(summary.median)
    if median == "diverges":
        low = text(summary.median_low)
        return median if low == median else f"{median} (from {low})"
    parts = f"{median} [{text(summary.median_low)}, {text(summary.median_high)}]"
    mean = text(summary.mean)
    if math.isnan(summary.mean_low) or mean == "diverges":
        return f"{parts}; {mean}"
    return f"{parts}; {mean} [{text(summary.mean_low)}, {text(summary.mean_high)}]"


def _unit(kind: str, unit: str) -> str:
    return {FORCE: f" [{unit}]", SHARE: " [%]", SECONDS: " [s]", PLAIN: ""}[kind]


def _printed(experiment: Experiment, column: Column, score: str) -> str:
    for row, name in experiment.published_rows.items():
        if name == score:
            value = published_value(experiment.published, column.published, row)
            if value is not None:
                return number(value)
    return ""


def experiment_table(experiment: Experiment, result: ExperimentResult) -> list[str]:
    """One row per score, one column per estimator: printed value, then ours."""
    unit, scale = unit_of(experiment.published)
    heads = [f"{c.name}" for c in experiment.columns]
    lines = [
        f"| score | {' | '.join(heads)} |",
        f"|---|{'---|' * len(heads)}",
    ]
    rates = [summary_of(result, c.name, "failed").mean for c in experiment.columns]
    lines.append(
        "| failure rate [%] | " + " | ".join(number(100.0 * rate) for rate in rates) + " |"
    )
    asked = set(experiment.published_rows.values())
    asked |= {"force_mean", "force_max", "force_rmse", "law_rmse"}
    asked.add(experiment.ranked_by)
    if not experiment.published_rows:
        asked |= set(CHANGE_ROWS)
    for honest, rows in ((False, ROWS), (True, HONEST_ROWS)):
        for score, heading, kind in rows:
            if not honest and score not in asked:
                continue
            cells = []
            for column in experiment.columns:
                if score not in result.columns[column.name]:
                    cells.append("–")
                    continue
                text = cell(summary_of(result, column.name, score), kind, scale)
                printed = _printed(experiment, column, score)
                cells.append(f"**{printed}** → {text}" if printed else text)
            if any(c != "–" for c in cells):
                lines.append(f"| {heading}{_unit(kind, unit)} | {' | '.join(cells)} |")
    return lines


def ratio_text(comparison: Comparison | None) -> str:
    """A verdict with the ratio that it rests on."""
    if comparison is None:
        return "–"
    ratio = comparison.ratio
    if ratio.count == 0 or comparison.verdict == FAILS:
        return f"{comparison.verdict}"
    low, high = number(ratio.median_low), number(ratio.median_high)
    return f"{comparison.verdict} ({number(ratio.median)} [{low}, {high}])"


def percent(share: float) -> str:
    """A relative error in percent, or that there is none worth a number."""
    return "lost" if not share < LOST else f"{number(100.0 * share)} %"


def interval(summary: Summary, scale: float = 1.0) -> str:
    """Median with its interval."""
    if summary.count == 0:
        return "–"
    median = number(summary.median * scale)
    if median == "diverges":
        return "fails"
    low, high = number(summary.median_low * scale), number(summary.median_high * scale)
    return f"{median} [{low}, {high}]"


def ratio_interval(summary: Summary) -> str:
    """Median of a ratio with its interval; in words where what is compared with failed."""
    if summary.count and not summary.median < LARGEST:
        return "they fail"
    return interval(summary)


def _shares(summary: Summary) -> str:
    if summary.count == 0:
        return "–"
    if not summary.median < LOST:
        return "lost"
    return f"{interval(summary, 100.0)} %"


def claims_table(results: Sequence[ExperimentResult]) -> list[str]:
    """The papers' claims: experiment, claim, what holds."""
    heads = "experiment", "claim of the paper", "printed ratio", "paper setting"
    lines = [f"| {' | '.join((*heads, 'practical setting'))} |", "|---|---|---|---|---|"]
    for result in results:
        experiment = load_experiment(result.name)
        found = {s: compare(experiment, result, s) for s in ("paper", "practical")}
        known = next((c for c in found.values() if c is not None), None)
        printed = "–" if known is None else number(known.published_ratio)
        lines.append(
            f"| [{result.name}]({PAGES}/{result.name}.md): {', '.join(experiment.covers)} "
            f"| {experiment.claim} | {printed} | {ratio_text(found['paper'])} "
            f"| {ratio_text(found['practical'])} |"
        )
    return lines


def printed_table(results: Sequence[ExperimentResult]) -> list[str]:
    """Our estimators against the printed force errors: which force, its error, what is met."""
    entries = {result.name: ours(load_experiment(result.name), result) for result in results}
    names = [entry.column for entry in entries[results[0].name]]
    heads = ["experiment", "best printed", f"{names[0]}: law at the parameters", "below it"]
    heads += ["largest error of an identifiable parameter", "within 5 %"]
    heads += ["force as reported", "one step ahead, second half", "regression"]
    heads += [f"{name}: law, below it, parameters" for name in names[1:]]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for result in results:
        experiment = load_experiment(result.name)
        unit, scale = unit_of(experiment.published)
        first, *others = entries[result.name]
        mark = " (not counted)" if experiment.not_counted else ""
        cells = [f"[{result.name}]({PAGES}/{result.name}.md){mark}"]
        printed = math.isfinite(first.best)
        cells.append(f"{number(first.best * scale)} {unit}" if printed else "–")
        cells += [interval(first.law, scale), first.law_below if printed else "–"]
        cells += [_shares(first.parameter_error), first.parameters_within]
        cells += [interval(first.reported, scale), interval(first.one_step, scale)]
        floor = first.floor
        cells.append("–" if math.isnan(floor) else f"{number(floor * scale)} {unit}")
        for entry in others:
            answer = entry.law_below if printed else "–"
            parameters = _shares(entry.parameter_error)
            cells.append(f"{interval(entry.law, scale)}, {answer}, {parameters}")
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def held_table(results: Sequence[ExperimentResult]) -> list[str]:
    """Force half a second ahead: ours against the best of the papers' filters, seed by seed."""
    entries = {result.name: ours(load_experiment(result.name), result) for result in results}
    names = [entry.column for entry in entries[results[0].name]]
    heads = ["experiment", f"{names[0]}: hold-forward RMSE"]
    heads += [f"best of the papers' filters over {name}, better" for name in names]
    lines = [f"| {' | '.join(heads)} |", f"|{'---|' * len(heads)}"]
    for result in results:
        found = entries[result.name]
        if not found[0].held_ratio.count:
            continue
        experiment = load_experiment(result.name)
        unit, scale = unit_of(experiment.published)
        mark = " (not counted)" if experiment.not_counted else ""
        cells = [f"[{result.name}]({PAGES}/{result.name}.md){mark}"]
        cells.append(f"{interval(found[0].held, scale)} {unit}")
        cells += [f"{ratio_interval(entry.held_ratio)}, {entry.held_better}" for entry in found]
        lines.append(f"| {' | '.join(cells)} |")
    return lines


def quick_numbers(result: ExperimentResult) -> dict[str, float]:
    """Median force RMSE [N] of the first seeds by column; infinite if most of them failed."""
    first = ExperimentResult(
        result.name,
        result.seeds[:QUICK_SEEDS],
        {
            column: {score: values[:QUICK_SEEDS] for score, values in scores.items()}
            for column, scores in result.columns.items()
        },
        result.identifiable,
        result.floors,
    )
    return {c: summary_of(first, c, "force_rmse").median for c in result.columns}


def quick_section(results: Sequence[ExperimentResult]) -> list[str]:
    """The marked section that a test regenerates with --quick and compares."""
    lines = [
        QUICK_BEGIN,
        f"Median force RMSE in N over the first {QUICK_SEEDS} seeds (`hc reproduce --quick`):",
        "",
        "| experiment | column | force RMSE [N] |",
        "|---|---|---|",
    ]
    for result in results:
        for column, value in quick_numbers(result).items():
            text = f"{value:.4g}" if value < 1e6 else "fails"
            lines.append(f"| {result.name} | {column} | {text} |")
    return [*lines, QUICK_END]
