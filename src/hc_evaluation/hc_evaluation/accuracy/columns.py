"""The columns of every experiment's table: heading, and how a row's figure is written."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from hc_evaluation.accuracy.run import EXPERIMENTS

Row = Mapping[str, Any]
Column = tuple[str, Callable[[Row], str]]


def _number(value: float | None, digits: int = 3) -> str:
    if value is None:
        return ""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "never"
    if value == 0.0:
        return "0"
    if abs(value) >= 1e5 or abs(value) < 1e-4:
        return f"{value:.1e}"
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(decimals, 6)}f}"


def _plain(key: str, digits: int = 3) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value = row.get(key)
        if isinstance(value, str):
            return value
        return _number(None if value is None else float(value), digits)

    return text


def _scaled(key: str, scale: float, digits: int = 2) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value = row.get(key)
        return "" if value is None else _number(scale * float(value), digits)

    return text


def _list(key: str, scale: float = 1.0, digits: int = 2) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        return " ".join(_number(scale * float(v), digits) for v in row.get(key, ()))

    return text


def _share(key: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        value = row.get(key)
        if value is None:
            return ""
        return "-" if math.isnan(value) else f"{100.0 * value:.1f} %"

    return text


def _pair(key: str, digits: int = 3) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        return f"{_number(float(row[key]), digits)} ± {_number(float(row[key + '_std']), 1)}"

    return text


def _words(key: str) -> Callable[[Row], str]:
    def text(row: Row) -> str:
        return ", ".join(row[key]) or "none"

    return text


_BELIEVED = (
    ("told wrong", _share("wrong")),
    ("runs with a tenth told wrong", _share("often")),
    ("K off, median", _share("K")),
    ("9 of 10 runs", _share("K_90")),
    ("its deviation", _share("deviation")),
    ("misfit told", _share("mismatch")),
    ("changes", _plain("changes")),
)
"""What a user would believe of K, over drawn contacts."""

COLUMNS: dict[str, tuple[Column, ...]] = {
    "tissues": (
        ("scenario", _plain("scenario")),
        ("RMS error % of K B, 1e-2 of n p", _list("rms_error", 100.0)),
        ("over bound", _list("ratio")),
        ("NEES", _plain("nees")),
        ("NIS", _plain("nis")),
        ("within 5 %", _share("within")),
        ("false alarms", _plain("changes")),
        ("force error N", _plain("force_rms", 2)),
    ),
    "changes": (
        ("scenario", _plain("scenario")),
        ("5 % after s", _plain("settling_s")),
        ("9 of 10 after s", _plain("settling_90_s")),
        ("bound s", _plain("bound_s")),
        ("error after 2 s", _share("error_after_2s")),
        ("called after s", _plain("delay_s")),
        ("missed", _plain("missed")),
        ("called before", _plain("early_calls")),
    ),
    "noise": (
        ("scenario", _plain("scenario")),
        ("NIS before", _plain("nis_before")),
        ("NIS after", _plain("nis_after")),
        ("worst error, median", _share("worst_error")),
        ("worst error, largest", _share("worst_error_max")),
        ("called a change", _plain("changes")),
    ),
    "recordings": (
        ("recording", _plain("recording")),
        ("hold-forward / floor", _plain("ratio")),
        ("least squares so far / floor", _plain("ratio_causal")),
        ("floor N", _plain("floor_n")),
        ("K B n p", _list("parameters", digits=3)),
        ("K off", _share("k_off")),
        ("n off", _share("n_off")),
        ("identifiability", _list("identifiability")),
        ("changes", _plain("changes")),
        ("mismatch told", _share("mismatch")),
    ),
    "excitation": (
        ("motion", _plain("scenario")),
        ("error of ln K, ln B, n, p", _list("error")),
        ("its deviation", _list("deviation")),
        ("identifiability", _list("identifiability")),
        ("NEES", _plain("nees")),
        ("changes", _plain("changes")),
        ("drift when free", _plain("free_drift")),
    ),
    "channels": (
        ("signals", _plain("name")),
        ("force late by s", _pair("delay_s")),
        ("force zero N", _pair("zero_n")),
        ("contact mm", _pair("contact_mm")),
        ("clear", _words("clear")),
        ("residual N", _plain("residual_rms_n")),
        ("without N", _plain("residual_rms_without_n")),
        ("K B n p then", _list("parameters", digits=3)),
        ("K B n p of the filter", _list("filter_parameters", digits=3)),
        ("mismatch told", _share("mismatch")),
    ),
    "random": (
        ("rate", _plain("rate")),
        ("runs", lambda row: str(row["runs"])),
        ("typical error over bound", _list("rms_ratio")),
        ("beyond 4 bounds", _share("far")),
        ("median NEES", _plain("nees")),
        ("NEES above 20", _share("nees_high")),
        ("NIS", _plain("nis")),
        ("within 5 %", _share("within")),
        ("false alarms", _plain("changes")),
        ("mismatch told", _share("mismatch")),
    ),
    "corners": (
        ("motion", _plain("motion")),
        ("error % of K B n p", _list("error", 100.0)),
        ("NEES", _plain("nees")),
        ("9 of 10 below", _plain("nees_90")),
        ("changes", _plain("changes")),
        ("mismatch told", _share("mismatch")),
    ),
    "misfit": (
        ("motion", _plain("motion")),
        ("hold-forward / floor", _plain("ratio")),
        ("9 of 10 below", _plain("ratio_90")),
        ("K off the batch fit", _share("k_off")),
        ("at 90 %, 9 of 10 runs", _share("k_90")),
        ("changes", _plain("changes")),
        ("misfit / force", _share("misfit")),
        ("mismatch told", _share("mismatch")),
    ),
    "separation": (
        ("scenario", _plain("scenario")),
        ("separated", _share("separated")),
        ("RMS error % of K B, 1e-2 of n p", _list("rms_error", 100.0)),
        ("over bound", _list("ratio")),
        ("NEES", _plain("nees")),
        ("NIS", _plain("nis")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "scan": (
        ("scan", _plain("scan")),
        ("error % of K, median", _scaled("median", 100.0)),
        ("at 95 %", _scaled("at_95", 100.0)),
        ("K B n p, median %, 1e-2", _list("medians", 100.0)),
        ("K within 3 deviations", _share("scores_within")),
        ("NIS", _plain("nis")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
        ("hold-forward / floor", _plain("ratio")),
    ),
    "delay": (
        ("contact", _plain("name")),
        ("ms off, median", _plain("error")),
        ("9 of 10 below", _plain("error_90")),
        ("its deviation", _plain("delay_std_ms")),
        ("K off, median", _share("K")),
        ("9 of 10", _share("K_90")),
        ("B off, median", _share("B")),
        ("9 of 10", _share("B_90")),
        ("contact mm off, 9 of 10", _plain("contact_90")),
        ("zero off, 9 of 10", _share("zero_90")),
        ("largest ms invented", _plain("largest")),
        ("ms found", _plain("delay_ms")),
        ("hold-forward / floor", _plain("ratio")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "surface": (
        ("surface", _plain("surface")),
        ("K off, median", _share("K")),
        ("at 90 %", _share("K_90")),
        ("RMS mm off, median", _plain("position")),
        ("9 of 10 below", _plain("position_90")),
        ("its deviation mm", _plain("deviation")),
        ("within 3 deviations", _share("covered")),
        ("said to be unknown", _share("unknown")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "rates": (
        ("readings", _plain("rates")),
        ("over bound", _list("ratio")),
        ("NEES", _plain("nees")),
        ("median", _plain("nees_median")),
        ("NIS of the force (ideal 1)", _plain("nis")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "multirate": (
        ("contact", _plain("contact")),
        ("delay ms off, median", _plain("off")),
        ("9 of 10 below", _plain("off_90")),
        ("most", _plain("off_most")),
        ("its deviation", _plain("deviation")),
        ("bound, tissue known", _plain("bound")),
        ("too far off", _plain("far")),
        ("K off, median", _share("K")),
        ("9 of 10", _share("K_90")),
        ("K within 3 deviations", _share("within")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "possible": (
        ("contacts", _plain("contacts")),
        ("runs", lambda row: str(row["runs"])),
        ("predicted / felt, one step", _plain("one_step")),
        ("held 0.5 s", _plain("held")),
        ("worst recording / last reading held", _plain("whole")),
        ("median recording", _plain("whole_median")),
        ("worst second / last reading held", _plain("ratio")),
        ("median run", _plain("ratio_median")),
    ),
    "troubles": (
        ("what is wrong", _plain("trouble")),
        *_BELIEVED,
    ),
    "places": (
        ("what differs", _plain("differs")),
        ("places", _plain("places")),
        ("force off, median", _share("force")),
        ("9 of 10 places", _share("force_90")),
        ("K off, median", _share("K")),
        ("9 of 10 places", _share("K_90")),
        ("its deviation", _share("deviation")),
        ("K within 3 deviations", _share("within")),
        ("told wrong", _share("wrong")),
        ("misfit told", _share("mismatch")),
        ("changes", _plain("changes")),
    ),
    "mechanics": (
        ("what lies between", _plain("trouble")),
        *_BELIEVED,
    ),
    "sensor_faults": (
        ("fault", _plain("fault")),
        ("K off, median", _share("K")),
        ("at 90 %, 9 of 10 runs", _share("K_90")),
        ("over that without a fault", _plain("over")),
        ("its deviation", _share("deviation")),
        ("K within 3 deviations", _share("within")),
        ("NEES", _plain("nees")),
        ("median", _plain("nees_median")),
        ("told wrong", _share("wrong")),
        ("runs with a tenth told wrong", _share("often")),
        ("misfit told", _share("mismatch")),
        ("changes", _plain("changes")),
    ),
    "together": (
        ("contact", _plain("pair")),
        ("K off, median", _share("K")),
        ("at 90 %, 9 of 10 runs", _share("K_90")),
        ("K within 3 deviations", _share("within")),
        ("deviations off at 90 %, 9 of 10 runs", _plain("score_90")),
        ("delay ms off, median", _plain("delay_ms")),
        ("9 of 10", _plain("delay_90_ms")),
        ("one step ahead / noise", _plain("predicted")),
        ("changes", _plain("changes")),
        ("misfit told", _share("mismatch")),
    ),
    "ablation": (
        ("off", _plain("off")),
        *((name, _plain(name)) for name, e in EXPERIMENTS.items() if not e.by_name_only),
        ("targets met, more or fewer", _plain("difference")),
    ),
    "defaults": (
        ("variation", _plain("variation")),
        ("worst over bound", _plain("ratio")),
        ("NEES from", _plain("nees_low")),
        ("to", _plain("nees_high")),
        ("NIS from", _plain("nis_low")),
        ("to", _plain("nis_high")),
        ("false alarms", _plain("false_alarms")),
        ("5 % after s", _plain("settling_s")),
        ("NEES, weak motion", _plain("weak_nees")),
        ("calls per misfit run", _plain("misfit_calls")),
        ("sine recordings / floor", _plain("recordings")),
        ("press / floor", _plain("press")),
        ("changes there", _plain("recorded_changes")),
    ),
    "filters": (
        ("filter", _plain("filter")),
        ("median error % of K B n p", _list("median_error", 100.0)),
        ("worst tissue", _plain("worst")),
        ("its error", _share("worst_error")),
        ("not within 5 %", _share("lost")),
        ("force error over the first's", _plain("force", 2)),
        ("NEES", _plain("nees", 2)),
        ("NIS", _plain("nis", 2)),
    ),
}
TARGET_COLUMNS: tuple[Column, ...] = (
    ("target", _plain("name")),
    ("value", _plain("value")),
    ("from", _plain("low")),
    ("to", _plain("high")),
    ("met", lambda row: "yes" if row["met"] else "NO"),
)
