"""The summary of a run: as plain data for --json, as a few lines for people."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from typing import Any

from hc_bringup.live import SYMBOLS
from hc_bringup.plain_json import finite
from hc_bringup.run_state import RunState
from hc_bringup.statistics import PARAMETERS
from hc_bringup.terminal.numbers import counted
from hc_bringup.zero_effect import ZeroEffect
from hc_bringup.zero_words import Zeros
from hc_estimator.stream.readings import MEANINGS, Check

_UNUSABLE = {
    Check.EXCHANGED.value: "force and displacement are exchanged",
    Check.SIGN.value: "the sign of a channel is wrong",
    Check.UNITS.value: "the unit of a channel is wrong",
    Check.TIMES.value: "the unit of the times is wrong",
    Check.STUCK.value: "a channel does not change",
}
"""Checks by whose failure the parameters are of no use."""
_BENDS_NOTHING = {Check.CLOCK.value, Check.VIBRATION.value}
"""Those of stamps, and of what goes up and down around what is felt."""
_WARNED = {check.value for check in Check} - _UNUSABLE.keys() - _BENDS_NOTHING
"""Those whose failure is a warning as long as the law fits all the same."""
OPEN_DELAY_S = 0.005
"""Deviation beyond which it cannot be said that there is no delay: B would be wrong by much."""
AT_LIMIT = 1e-3
"""Share of a limit within which an exponent stands at it."""
MISFIT_SHARE = 0.5
"""Of the samples: where the law does not fit in more of them, what is doubted has spoilt it."""


def run_summary(
    state: RunState,
    bag: str | None,
    further_bags: Sequence[str] = (),
    *,
    with_latency: bool = True,
) -> dict[str, Any]:
    """Return what docs/design.md lists for hc run --json, and a little more.

    force_rmse_n is the one-step-ahead error in contact: the force predicted before the sample was
    used against the measured one, without the first second of contact (see `force_error`);
    force_aligned_rmse_n is that of readings brought to the same time. silent_s says since when no
    estimate came where the run was ended in silence, None elsewhere. lost counts samples that were
    published and for which no estimate came; None where that cannot be told, and where the run has
    no estimator (estimating is false). messages counts what the source published of whatever type,
    None where it does not say; of a bag without samples it is all that is known. left_out counts
    what there was a reason for: "skipped" when the estimator was behind, "alone" of a sensor
    without the other, "before_the_first" that was heard of the rig; not_seen counts estimates that
    were made and did not come here: no figure counts them. not_recorded counts messages that never
    reached the recorder: it stood still, or was behind, for longer than publishers keep them.
    failures says why the run counts as failed although it went on to its end. estimator names whose
    figures these are, and others holds the same of further estimators of the run.

    Args:
        state: the run at its end.
        bag: folder of the recorded bag, or None.
        further_bags: those of recorders that were started again.
        with_latency: False where the stamps are not of the time of publication (a replay).
    """
    statistics = state.statistics
    latency = statistics.latency
    effect = statistics.touch.effect(statistics.latest)
    samples, lost = state.samples, statistics.lost if statistics.counts else None
    if samples is None or samples < statistics.estimates:
        # The source did not say its last count: all that is known are the sequence numbers.
        samples = statistics.estimates + (lost or 0)
    else:
        lost = max(0, samples - statistics.estimates - state.unseen)
    nobody_estimates = not (state.estimating or statistics.estimates)
    if nobody_estimates:  # the hand's side of a teleoperation: none of its samples has an estimate
        lost = None
    left_out = dict(state.left_out)
    early = statistics.first_sequence or 0  # the rig counts from 0, a player as its bag does
    if with_latency and state.samples is not None and 0 < early <= (lost or 0):
        left_out["before_the_first"] = early
    summary = {
        "samples": samples,
        "messages": state.messages,
        "lost": lost,
        "left_out": left_out,
        "estimates": statistics.estimates,
        "estimating": not nobody_estimates,
        "not_seen": state.unseen,
        "rejected": dict(statistics.rejected),
        "changes_detected": statistics.changes,
        "model_mismatch_share": _share(statistics.mismatch, statistics.estimates),
        "duration_s": state.elapsed_s,
        "silent_s": state.silent_s if state.silent else math.nan,
        "silent_reason": state.silent_reason if state.silent else "",
        "suspicions": state.suspicions,
        "respawns": state.respawns,
        "cpu_percent": dict(state.cpu_percent),
        "parameters": statistics.parameters(),
        "parameters_std": statistics.parameters_std(),
        "identifiability": statistics.identifiability(),
        "channel_delay": statistics.channel_delay[0],
        "channel_delay_std": statistics.channel_delay[1],
        **statistics.zeros(),
        "stiffness_if_position_off": effect.by_position,
        "stiffness_if_force_zero_off": effect.by_force_zero,
        "force_rmse_n": statistics.force_rmse_n,
        "force_aligned_rmse_n": statistics.force_aligned_rmse_n,
        "bag": bag,
        "further_bags": list(further_bags),
        "not_recorded": sum(state.dropped.values()),
        "failures": list(state.failures),
        "estimator": state.estimator,
        "others": [run_summary(one, None, with_latency=with_latency) for one in state.others],
    }
    if with_latency:
        summary["latency_us"] = {
            "p50": 1e6 * latency.quantile_s(0.5),
            "p99": 1e6 * latency.quantile_s(0.99),
            "max": 1e6 * latency.maximum_s if latency.count else math.nan,
        }
        summary["foreign_stamps"] = statistics.foreign_stamps
    return summary


def why_unusable(checks: Iterable[str], mismatch_share: float) -> str:
    """Say why the parameters are of no use; nothing where what is doubted is a warning.

    Args:
        checks: what is doubted (hc_estimator.stream.readings.Check, its values).
        mismatch_share: of the samples in which the contact law did not fit; NaN if there are none.
    """
    checks = list(checks)
    wrong = dict.fromkeys(_UNUSABLE[check] for check in checks if check in _UNUSABLE)
    if wrong:
        return f"these are not the parameters of the tissue, for {' and '.join(wrong)}"
    if mismatch_share > MISFIT_SHARE and not _WARNED.isdisjoint(checks):
        return (
            "these are hardly the parameters of the tissue, for the contact law did not fit in "
            f"{100 * mismatch_share:.0f} % of the samples"
        )
    return ""


def _share(part: int, whole: int) -> float:
    return part / whole if whole else math.nan


def to_json(summary: dict[str, Any]) -> str:
    """Return a summary as JSON; numbers that are not finite become null."""
    return json.dumps(finite(summary), indent=2)


def parameter_lines(
    values: dict[str, float], deviations: dict[str, float], known: dict[str, float] | None = None
) -> list[str]:
    """Return a line for each parameter: symbol, value, standard deviation, unit."""
    lines = []
    for name in PARAMETERS:
        symbol, unit = SYMBOLS[name]
        line = f"  {symbol} = {values[name]:<10.5g} ± {deviations[name]:<8.2g} {unit:<15}"
        # What is held is not looked for.
        limit = _limit_of(name, values[name]) if deviations[name] > 0.0 else ""
        if limit:
            line += f" {limit}: it may be beyond, and the deviation says nothing"
        elif known is not None and not math.isnan(known[name]):
            line += f" {100 * known[name]:4.0f} % known from the data"
        lines.append(line.rstrip())
    return lines


def _limit_of(name: str, value: float) -> str:
    """Say where an exponent stands at the end of what the default filter looks for; else empty."""
    from hc_estimator.multiple_model import rows  # compiled code, which not all that print need

    limits = {
        "displacement_exponent": (rows.SMALLEST_EXPONENT, rows.LARGEST_EXPONENT),
        "velocity_exponent": (rows.SMALLEST_VELOCITY_EXPONENT, rows.LARGEST_VELOCITY_EXPONENT),
    }
    for limit, which in zip(limits.get(name, ()), ("smallest", "largest"), strict=False):
        if abs(value - limit) < AT_LIMIT * limit:
            return f"the {which} that is looked for"
    return ""


def delay_lines(summary: dict[str, Any]) -> list[str]:
    """Return a line about the delay between the channels, none where it is not known."""
    delay, deviation = summary["channel_delay"], summary["channel_delay_std"]
    if not (math.isfinite(delay) and math.isfinite(deviation)):
        return []
    late = "force" if delay >= 0.0 else "displacement"
    if deviation == 0.0:  # a number that the estimator was given
        how = (
            f"the {late} is taken for {1e3 * abs(delay):.2f} ms late"
            if delay
            else "the channels are taken to be in step"
        )
        return [f"{how}, as was set (channel_delay)"]
    size = f"{1e3 * abs(delay):.2f} ± {1e3 * deviation:.2f} ms"
    if abs(delay) <= 2.0 * deviation and deviation > OPEN_DELAY_S:
        return [
            f"whether force and displacement are out of step is open: {size}; K, B, n and p are as "
            "unsure as that makes them"
        ]
    if abs(delay) <= 2.0 * deviation:
        return [f"no delay between force and displacement is to be seen: {size}"]
    return [f"the {late} is late by {size}"]


def zero_lines(summary: dict[str, Any]) -> list[str]:
    """Return a line about zeros that were found, or what those that are off would do; or none."""
    names = ("stiffness_if_position_off", "stiffness_if_force_zero_off")
    words = ZeroEffect(*(summary[name] for name in names)).words
    if not words:
        said = Zeros(*(summary[name] for name in Zeros._fields)).words
        return [said] if said else []
    return [
        f"{words} (how well you know them: --param contact_position_std=MM "
        "--param force_zero_std=N)"
    ]


def aligned_lines(one_step_n: float, aligned_n: float) -> list[str]:
    """Return a line where a delay sets the readings of one moment apart from those of one stamp."""
    if not (math.isfinite(aligned_n) and abs(aligned_n - one_step_n) > 0.01 * one_step_n):
        return []
    return [
        f"with the readings of both channels brought to the same time: {millinewton(aligned_n)}"
    ]


def millinewton(force_n: float) -> str:
    """Return a force in mN with its unit; small ones keep two digits, large ones are in N."""
    if math.isnan(force_n):
        return "-"
    if abs(force_n) >= 10.0:
        return f"{force_n:.1f} N" if abs(force_n) < 1e4 else f"{force_n:.3g} N"
    return f"{1e3 * force_n:.1f} mN" if abs(force_n) >= 1e-3 else f"{1e3 * force_n:.2g} mN"


_REJECTED = {
    "not_finite": "a reading that is no finite number, or a force before the first displacement",
}
_LEFT_OUT = {
    "skipped": "skipped, for more than input.maximum_backlog waited: the computer was too busy "
    "(hc run --realtime, fewer programs, or a larger backlog)",
    "alone": "of a sensor without the other (the first and last of a run count here, too)",
    "before_the_first": "before the first that was heard: the rig began while others still looked "
    "for it; say start_paused, expected_sample_subscribers and expected_estimate_subscribers in "
    "the plan, as config/run.yaml does",
}


def _lost(count: int | None) -> str:
    return "? (the sequence numbers of the samples do not count)" if count is None else str(count)


def run_text(summary: dict[str, Any]) -> str:
    """Return the summary of a run as lines for a person."""
    cpu = ", ".join(f"{name} {percent:.0f} %" for name, percent in summary["cpu_percent"].items())
    lines = _estimator_lines(summary)
    if summary["respawns"]:
        lines.append(f"nodes that died and were started again: {summary['respawns']}")
    lines.append(f"processor use: {cpu}")
    lines += _parameter_lines(summary)
    for other in summary["others"]:
        lines += [*_estimator_lines(other), *_parameter_lines(other)]
    if summary["not_recorded"]:
        lines.append(
            f"not in the bag: {counted(summary['not_recorded'], 'message')}; the recorder stood "
            "still, or the computer was too busy"
        )
    if summary["bag"]:
        bags = [summary["bag"], *summary["further_bags"]]
        lines.append(f"bag{'s' * (len(bags) > 1)}: {', '.join(bags)}")
    return "\n".join(lines)


def _estimator_lines(summary: dict[str, Any]) -> list[str]:
    """Return what came of the samples of an estimator."""
    rejected = ", ".join(f"{n} {reason}" for reason, n in summary["rejected"].items()) or "none"
    name = summary["estimator"]
    whose = f"{name}: " if "/" in name or summary["others"] else ""
    count = f"{summary['samples']} samples"
    if not summary["samples"] and summary["messages"]:
        count = f"{summary['messages']} messages"
    if not summary["estimating"]:
        return [f"{count} in {summary['duration_s']:.1f} s, and no estimator"]
    lines = [
        f"{whose}{summary['estimates']} estimates of {count} in "
        f"{summary['duration_s']:.1f} s; lost {_lost(summary['lost'])}, rejected {rejected}"
    ]
    lines += [
        f"{reason}: {meaning}"
        for reason, meaning in _REJECTED.items()
        if summary["rejected"].get(reason)
    ]
    if summary["not_seen"]:
        lines.append(
            f"{summary['not_seen']} more estimates were made while this display stood still: they "
            "are in no figure here, but in the bag"
        )
    if summary["lost"]:
        lines += [f"of these {n} {_LEFT_OUT[reason]}" for reason, n in summary["left_out"].items()]
    if math.isfinite(summary["silent_s"]):
        reason = f": {summary['silent_reason']}" if summary["silent_reason"] else ""
        lines.append(f"silent at the end, for {summary['silent_s']:.1f} s{reason}")
    if "latency_us" in summary and summary["estimates"]:
        lines.append(_latency_line(summary["latency_us"], summary["foreign_stamps"]))
    lines += [f"what cannot be right: {s}" for s in summary["suspicions"].values()]
    if summary["suspicions"]:
        lines.append(f"what each means and what to do: {MEANINGS}; hc doctor BAG, or live")
    return lines


def _latency_line(latency_us: dict[str, float], foreign_stamps: int) -> str:
    """Return how late the estimates came, as far as the stamps are of this computer's clock."""
    if math.isnan(latency_us["p50"]):
        return "stamp to estimate: the stamps are of another clock"
    figures = ", ".join(f"{name} {value:.0f} us" for name, value in latency_us.items())
    if not foreign_stamps:
        return f"stamp to estimate: {figures}"
    without = counted(foreign_stamps, "sample")
    return f"stamp to estimate: {figures}, without {without} stamped by another clock"


def _parameter_lines(summary: dict[str, Any]) -> list[str]:
    """Return what an estimator found, nothing where no estimate came."""
    lines = []
    if summary["estimates"]:
        lines += parameter_lines(
            summary["parameters"], summary["parameters_std"], summary["identifiability"]
        )
        lines += delay_lines(summary) + zero_lines(summary)
        lines += [
            "force one step ahead, after the first second of contact: RMS error "
            + millinewton(summary["force_rmse_n"]),
            *aligned_lines(summary["force_rmse_n"], summary["force_aligned_rmse_n"]),
            f"changes of the tissue: {summary['changes_detected']}; contact law did not fit in "
            f"{100 * summary['model_mismatch_share']:.0f} % of the estimates",
        ]
    return lines
