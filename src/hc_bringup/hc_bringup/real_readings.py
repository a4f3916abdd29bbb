"""A recording of what was read, when it was read.

Without samples that are no readings, repeated and interpolated ones, and with times of measurement
where the stamps are those of arrival.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any


def at_even_times(recording: Any, settings: Mapping[str, Any]) -> Any:
    """Return a table of readings at the even times at which they were taken.

    Where its stamps are those of arrival, and nobody said what they are. A bag's own estimates are
    found by their stamps: it is left as it is.

    Args:
        recording: hc_logger.recorded.Recording.
        settings: of the input, by name.
    """
    import numpy as np

    from hc_bringup.read_otherwise import at_own_stamps
    from hc_estimator.stream.arrival_stamps import find_even_times

    if recording.is_bag:
        return recording
    columns = {"position": recording.displacement_mm, "force": recording.force_n}
    there = {name: np.isfinite(recording.time_s) & np.isfinite(columns[name]) for name in columns}
    if np.array_equal(*there.values()):
        together = [tuple(columns)]
    else:
        together = [(name,) for name in columns]
    stamps = dict.fromkeys(columns, recording.stamps)
    notes = []
    for names in together:
        if any(f"{name}.stamps" in settings for name in names):
            continue
        rows = there[names[0]]
        found = find_even_times(recording.stamps[rows], *(columns[name][rows] for name in names))
        if found is None:
            continue
        moved = recording.stamps.copy()
        moved[rows] = found.stamps_ns
        stamps |= dict.fromkeys(names, moved)
        of = (
            ""
            if len(names) > 1
            else f" of the {'displacement' if names == ('position',) else 'force'}"
        )
        back = " ".join(f"--input {name}.stamps=measured" for name in names)
        notes.append(
            f"the stamps{of} are those of arrival, up to {1e3 * found.late_s:.2g} ms off: read at "
            f"an even {found.rate_hz:.4g} Hz ({back}: as they stand)"
        )
    return _noted(at_own_stamps(recording, *stamps.values()), notes)


def less_repeated(recording: Any, settings: Mapping[str, Any]) -> Any:
    """Return a recording in which each reading of a channel that is repeated counts once.

    Who says whether a channel is held is believed. A note says at what rate the channel comes.

    Args:
        recording: hc_logger.recorded.Recording.
        settings: of the input, by name.
    """
    import numpy as np

    from hc_bringup.read_otherwise import each_once
    from hc_estimator.stream.channel_checks import held
    from hc_estimator.stream.readings import Readings
    from hc_estimator.stream.stamp_checks import rate_of

    found, notes = {}, []
    for name, column in (("displacement", "displacement_mm"), ("force", "force_n")):
        setting = "position.held" if name == "displacement" else "force.held"
        if setting in settings:
            continue
        values = getattr(recording, column)
        there = np.flatnonzero(np.isfinite(values) & np.isfinite(recording.time_s))
        time_s = recording.time_s[there]
        _sentence, repeats = held(Readings(name, "", time_s, values[there]))
        if np.isnan(repeats):
            continue
        found[setting] = True
        notes.append(
            f"the {name} repeats readings of {rate_of(time_s) / repeats:.4g} Hz: each counts once "
            f"(--input {setting}=false: all of them)"
        )
    return _noted(each_once(recording, found), notes)


def less_interpolated(recording: Any) -> Any:
    """Return a recording with the readings alone of a channel that lies on lines between them.

    Rows that are left without any reading are gone; a note says at what rate the channel comes.

    Args:
        recording: hc_logger.recorded.Recording.
    """
    import numpy as np

    from hc_bringup.read_otherwise import less_empty
    from hc_estimator.stream.interpolated import find_interpolation

    changed, notes = {}, []
    lost = np.zeros(len(recording.time_s), np.bool_)
    for name, column in (("displacement", "displacement_mm"), ("force", "force_n")):
        values = getattr(recording, column)
        there = np.flatnonzero(np.isfinite(values) & np.isfinite(recording.time_s))
        found = find_interpolation(recording.time_s[there], values[there])
        if found is None:
            continue
        kept = values.copy()
        left_out = there[~found.keep]
        kept[left_out] = np.nan
        lost[left_out] = True
        changed[column] = kept
        notes.append(
            f"the {name} is interpolated between readings of {found.rate_hz:.4g} Hz: only those "
            "are used"
        )
    if not changed:
        return recording
    read = _noted(dataclasses.replace(recording, **changed), notes)
    return less_empty(read, lost)


def _noted(recording: Any, notes: list[str]) -> Any:
    """Return a recording with more to be said of how it was read."""
    if not notes:
        return recording
    findings = recording.findings
    return dataclasses.replace(
        recording, findings=findings._replace(notes=(*findings.notes, *notes))
    )
