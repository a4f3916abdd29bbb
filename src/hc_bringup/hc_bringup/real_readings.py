"""A recording without the samples that were only interpolated between readings of a channel."""

from __future__ import annotations

import dataclasses
from typing import Any


def less_interpolated(recording: Any) -> Any:
    """Return a recording with the readings alone of a channel that lies on lines between them.

    Rows that are left without any reading are gone; a note says at what rate the channel comes.

    Args:
        recording: hc_logger.recorded.Recording.
    """
    import numpy as np

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
    findings = recording.findings
    read = dataclasses.replace(
        recording, findings=findings._replace(notes=(*findings.notes, *notes)), **changed
    )
    rows = ~(lost & np.isnan(read.displacement_mm) & np.isnan(read.force_n))
    if rows.all():
        return read
    columns = ("time_s", "stamps", "sequence", "displacement_mm", "force_n")
    return dataclasses.replace(read, **{name: getattr(read, name)[rows] for name in columns})
