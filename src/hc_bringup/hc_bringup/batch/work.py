"""One recording through some variants: what a worker does, and the files that it leaves.

A result is a file whose name follows from the recording's content, from all settings and from the
software: whoever makes it again, on whatever machine, writes the same bytes, so that nothing is
lost and nothing counts twice when a worker dies or a batch is taken up again.
"""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import math
import re
import shlex
import traceback
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from hc_bringup import recording_input
from hc_bringup.batch.software import software_stamp
from hc_bringup.batch.sources import content_hash
from hc_bringup.batch.variants import Variant
from hc_bringup.commands.contacts import contact_rules, tip_source
from hc_bringup.commands.estimate import make_estimator, summarise, why_no_result
from hc_bringup.errors import UserError
from hc_bringup.estimate_table import estimate_lines, write_parquet
from hc_bringup.file_preset import CSV_OPTIONS
from hc_bringup.reading_changes import read_alike
from hc_bringup.report.contact_file import PARAMETER_UNITS, columns
from hc_bringup.report.contacts import find_contacts
from hc_bringup.run_data import of_series
from hc_bringup.sensor_effect import doubted_effects
from hc_bringup.sites import run_by_site
from hc_bringup.summary import why_unusable
from hc_bringup.taken_off_live import not_taken_off
from hc_bringup.zero_words import Zeros
from hc_estimator import PARAMETER_NAMES
from hc_estimator.stream.in_pieces import run_in_pieces
from hc_estimator.stream.sanity import check_samples
from hc_logger.new_file import new_file
from hc_msgs_py.entry_points import FaultOfAnotherError

FORMAT: Final = 1
"""Of results; raised when their meaning changes."""
UNREADABLE: Final = "unreadable"
_READING: Final = (
    *("sensors", "find_surface", *CSV_OPTIONS, "tip", "tip_axes", "sites"),
    *("minimum_depth", "minimum_force", "minimum_duration", "release"),
)
"""Options that decide how a recording is read, and what counts as a contact."""


class ResultError(Exception):
    """A result cannot be written; the text says why."""


class WrongSoftwareError(Exception):
    """A worker runs other software than who asks it."""


@dataclass(frozen=True)
class Task:
    """One recording through some variants.

    Attributes:
        number: of the recording, from 0.
        path: of the recording.
        variants: numbers and ways to estimate.
        arguments: options that say how recordings are read and what counts as a contact.
        folder: of the batch.
        estimates: format of the full estimates, empty for none.
        resume: whether a result that is there is kept.
        stamp: of the software that asks.
    """

    number: int
    path: Path
    variants: tuple[tuple[int, Variant], ...]
    arguments: argparse.Namespace
    folder: Path
    estimates: str
    resume: bool
    stamp: str


@dataclass(frozen=True)
class Answer:
    """What became of a task.

    Attributes:
        number: of the recording.
        content: SHA-256 of the recording; empty if it cannot be read.
        size: its bytes.
        keys: names of the results by number of the variant.
        made: how many of them were made now, rather than kept, and have numbers.
    """

    number: int
    content: str
    size: int
    keys: dict[int, str]
    made: int


def analyse(task: Task) -> Answer:
    """Do a task; whatever is wrong with the recording is a result too.

    Raises:
        WrongSoftwareError: if this process runs other software than who asks.
        ResultError: if a result cannot be written.
    """
    if task.stamp != software_stamp():
        raise WrongSoftwareError
    try:
        content, size = content_hash(task.path)
    except OSError as error:
        return _give_up(task, "", 0, f"cannot be read: {error.strerror or error}")
    keys = {n: result_key(task, variant, content) for n, variant in task.variants}
    waiting = [(n, v) for n, v in task.variants if not (task.resume and _is_there(task, keys[n]))]
    made = 0
    if waiting:
        recording, reason, again = _read(task)
        for number, variant in waiting:
            if recording is None:
                result = _failure(reason, again=again)
            else:
                name = Path("estimates", f"recording={content[:16]}", keys[number][:16])
                result = _estimate(task, variant, recording, name)
            write_result(task.folder, keys[number], result)
            made += not result["reason"]
    return Answer(task.number, content, size, keys, made)


def died(task: Task) -> Answer:
    """Return the answer to a task that ends its worker each time, with results that say so."""
    reason = "the worker process ended while it worked on it (not enough memory?)"
    return _give_up(task, "", 0, reason)


def result_key(task: Task, variant: Variant, content: str) -> str:
    """Return the name of a result: a hash of all that it depends on."""
    options = vars(task.arguments)
    what = {
        "format": FORMAT,
        "software": task.stamp,
        "content": content,
        "configuration": variant.configuration,
        "options": {name: options[name] for name in _READING},
    }
    text = json.dumps(what, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def result_path(folder: Path, key: str) -> Path:
    """Return where a result is."""
    return folder / "results" / key[:2] / f"{key}.json"


def read_result(folder: Path, key: str) -> dict[str, Any]:
    """Return a result: reason, again, recording (values by column), contacts (lists by column).

    `places` has the columns that say which place each contact is of, with --sites.

    Raises:
        OSError: if it is not there.
        ValueError: if it is damaged.
    """
    result = json.loads(result_path(folder, key).read_bytes())
    if not isinstance(result, dict):
        raise ValueError("not a result")
    return result


def write_result(folder: Path, key: str, result: dict[str, Any]) -> None:
    """Write a result whole or not at all; one that is there is the same, and replaced."""
    with _result_file(result_path(folder, key)) as file:
        file.write(json.dumps(result, separators=(",", ":")).encode())


@contextlib.contextmanager
def _result_file(path: Path) -> Iterator[Any]:
    """Write a file of the batch whole or not at all.

    Raises:
        ResultError: if it cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with new_file(path, overwrite=True) as file:
            yield file
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror or error}") from error


_OF_THE_TISSUE: Final = tuple(
    f"{name}{what}" for name in PARAMETER_NAMES for what in ("", "_std", "_identifiability")
)


_OF_A_PLACE: Final = (*_OF_THE_TISSUE, *Zeros._fields)


def recording_units() -> dict[str, str]:
    """Return the columns of a recording's row and the units that stand behind their names."""
    units = {"duration": "s", "samples": "1", "used": "1", "in_contact": "1", "rejected": "1"}
    units |= {"contacts": "1", "changes": "1", "mismatch_share": "1"}
    for name, unit in zip(PARAMETER_NAMES, PARAMETER_UNITS, strict=True):
        units |= {name: unit, f"{name}_std": unit, f"{name}_identifiability": "1"}
    units |= {"channel_delay": "s", "channel_delay_std": "s"}
    units |= {"contact_position": "mm", "contact_position_std": "mm"}
    units |= {"force_zero": "N", "force_zero_std": "N"}
    return units | {"force_predicted_rmse": "N", "force_reconstructed_rmse": "N", "nis_mean": "1"}


def _is_there(task: Task, key: str) -> bool:
    """Whether a result need not be made again: it is whole, and nothing of the machine's fault."""
    try:
        result = read_result(task.folder, key)
    except (OSError, ValueError):
        return False
    if result["again"]:
        return False
    if not task.estimates or not result["recording"]:
        return True
    name = str(result["estimates"])
    return name.endswith(f".{task.estimates}") and (task.folder / name).is_file()


def _give_up(task: Task, content: str, size: int, reason: str) -> Answer:
    """Leave results that say that nothing can be known of a recording, for now."""
    keys = {}
    for number, variant in task.variants:
        keys[number] = result_key(task, variant, f"{UNREADABLE} {task.path}")
        write_result(task.folder, keys[number], _failure(reason, again=True))
    return Answer(task.number, content, size, keys, 0)


def _read(task: Task) -> tuple[Any, str, bool]:
    """Return the recording, or why there is none and whether that may pass."""
    arguments = argparse.Namespace(**vars(task.arguments))
    arguments.input = str(task.path)
    try:
        return recording_input.load(arguments, one_of_many=True), "", False
    except UserError as error:
        return None, _about(task, str(error)), False
    except MemoryError:
        return None, "not enough memory to read it", True
    except OSError as error:
        return None, f"cannot be read: {error.strerror or error}", True
    except Exception as error:  # noqa: BLE001 - one recording never stops the others
        return None, _internal(error), False


def _estimate(task: Task, variant: Variant, recording: Any, name: Path) -> dict[str, Any]:
    try:
        return _estimated(task, variant, recording, name)
    except UserError as error:
        return _failure(_about(task, str(error)))
    except MemoryError:
        return _failure("not enough memory to estimate", again=True)
    except OSError as error:
        return _failure(f"cannot be read: {error.strerror or error}", again=True)
    except ResultError:
        raise
    except Exception as error:  # noqa: BLE001 - one recording never stops the others
        return _failure(_internal(error), where=traceback.format_exc())


def _estimated(task: Task, variant: Variant, recording: Any, name: Path) -> dict[str, Any]:
    """Estimate; the full estimates go to a file of this name in the batch's folder, if asked."""
    tip = tip_source(task.arguments)
    by_site = None
    if task.arguments.sites:
        by_site = run_by_site(recording, tip, lambda part: make_estimator(variant.arguments, part))
        recording, estimator, series = by_site.recording, by_site.estimator, by_site.series
    else:
        estimator = make_estimator(variant.arguments, recording)
        channels = (recording.time_s, recording.displacement_mm, recording.force_n)
        series = run_in_pieces(estimator, *channels)
    summary = summarise(estimator, recording, series, math.nan)
    limit_n = float(estimator.configuration["force_limit"])
    once = recording.counted_once
    suspicions = check_samples(*read_alike(recording), limit_n, once)
    suspicions += doubted_effects(recording, suspicions, summary)
    # A law that hardly fits is in the row's mismatch_share; a channel that is turned is no result.
    reason = why_unusable((s.check.value for s in suspicions), math.nan) or why_no_result(summary)
    contacts = []
    if not reason:
        data = by_site.data if by_site else of_series(recording, estimator, series, tip)
        contacts = find_contacts(data, contact_rules(task.arguments))
    said = (not_taken_off(recording, task.arguments), *(s.sentence for s in suspicions))
    result = _failure(reason)
    lines = filter(None, (*recording.findings.lines(), *said))
    result["notes"] = [_about(task, line) for line in lines]
    result["recording"] = _row(recording, summary, len(contacts))
    if reason:  # whoever takes a column of numbers for results is to find none
        result["recording"] |= dict.fromkeys(_OF_THE_TISSUE, math.nan)
    result["contacts"] = columns(contacts)
    if by_site:  # what an estimator knew in the end is of the last place alone
        result["places"] = by_site.columns(contacts)
        result["recording"] |= dict.fromkeys(_OF_A_PLACE, math.nan)
    if task.estimates:
        relative = name.with_suffix(f".{task.estimates}")
        _write_estimates(task.folder / relative, task.estimates, recording, series)
        result["estimates"] = relative.as_posix()
    return result


def _failure(reason: str, *, again: bool = False, where: str = "") -> dict[str, Any]:
    """Return a result without numbers; `again`: another time it may turn out otherwise."""
    return {
        "reason": reason,
        "again": again,
        "where": where,
        "notes": [],
        "estimates": "",
        "recording": {},
        "contacts": {},
        "places": {},
    }


def _row(recording: Any, summary: dict[str, Any], contacts: int) -> dict[str, Any]:
    """Return the values of a recording's row by column."""
    with np.errstate(invalid="ignore", over="ignore"):  # times need not be finite
        times = recording.time_s[np.isfinite(recording.time_s)]
    row: dict[str, Any] = {
        "duration": float(times.max() - times.min()) if len(times) else math.nan,
        "rejected": sum(summary["rejected"].values()),
        "contacts": contacts,
        "changes": summary["changes_detected"],
        "mismatch_share": summary["model_mismatch_share"],
        "force_predicted_rmse": summary["force_predicted_rmse_n"],
        "force_reconstructed_rmse": summary["force_reconstructed_rmse_n"],
    }
    same = ("samples", "used", "in_contact", "channel_delay", "channel_delay_std", "nis_mean")
    for name in (*same, *Zeros._fields):
        row[name] = summary[name]
    for name in PARAMETER_NAMES:
        row[name] = summary["parameters"][name]
        row[f"{name}_std"] = summary["parameters_std"][name]
        row[f"{name}_identifiability"] = summary["identifiability"][name]
    return row


def _write_estimates(path: Path, kind: str, recording: Any, series: Any) -> None:
    """Write every estimate, with the columns of hc estimate -o."""
    lines = estimate_lines(recording, series)
    with _result_file(path) as file:
        if kind == "csv":
            for part in lines:
                file.write(part.encode())
        else:
            write_parquet(file, lines)


def _about(task: Task, text: str) -> str:
    """Return a line about a recording without its path: the same recording may lie elsewhere."""
    path = str(task.path)
    text = text.removeprefix(f"{path}: ")
    for written in {shlex.quote(path), path}:  # in what is to be typed, a word in its place
        text = re.sub(rf"(\bhc [a-z ]+ ){re.escape(written)}(?!\S)", r"\1RECORDING", text)
    return text.replace(path, "the recording")


def _internal(error: Exception) -> str:
    said = " ".join(str(error).split())[:200]
    if isinstance(error, FaultOfAnotherError):
        return said
    return f"internal error, please report it: {type(error).__name__}: {said}".removesuffix(": ")
