"""The table of all estimates of a recording: what hc estimate -o and hc batch write."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from hc_bringup.errors import UserError

_LINES_AT_ONCE = 4096
COLUMNS = (
    "time_s,displacement_mm,force_N,stiffness [N/mm^n],damping [N(s/mm)^p/mm^n],"
    "displacement_exponent,velocity_exponent,stiffness_std [N/mm^n],"
    "damping_std [N(s/mm)^p/mm^n],displacement_exponent_std,velocity_exponent_std,"
    "force_predicted_N,force_reconstructed_N,nis,contact,change_detected,rejected,"
    "stiffness_identifiability,damping_identifiability,displacement_exponent_identifiability,"
    "velocity_exponent_identifiability,model_mismatch,channel_delay_s,"
    "channel_delay_std_s,contact_position_mm,contact_position_std_mm,force_zero_N,force_zero_std_N"
)


def write_estimates(path: Path, recording: Any, series: Any) -> None:
    """Write a new file of estimates.

    Raises:
        UserError: if it cannot be written.
    """
    from hc_logger.errors import BagError
    from hc_logger.new_file import write_new_text

    try:
        write_new_text(path, estimate_lines(recording, series))
    except BagError as error:
        raise UserError(str(error)) from error


def estimate_lines(recording: Any, series: Any) -> Iterator[str]:
    """Yield one line a sample, many at once; rejected is empty for a sample that was used.

    K, B, n, p are in N/mm^n, N (s/mm)^p / mm^n, 1 and 1; the other units stand in the names.
    """
    import numpy as np

    from hc_estimator import Rejection

    names = {code.value: code.name.lower() if code else "" for code in Rejection}
    numbers = np.column_stack(
        [
            recording.time_s,
            recording.displacement_mm,
            recording.force_n,
            series.parameters,
            series.parameters_std,
            series.force_predicted,
            series.force_reconstructed,
            series.nis,
        ]
    ).tolist()
    flags = np.column_stack([series.contact, series.change_detected, series.model_mismatch])
    known = np.column_stack(
        [
            series.identifiability,
            series.channel_delay,
            series.channel_delay_std,
            series.contact_position,
            series.contact_position_std,
            series.force_zero,
            series.force_zero_std,
        ]
    ).tolist()
    codes = series.rejected.tolist()
    lines = (
        f"{','.join(map(repr, row))},{flag[0]},{flag[1]},{names[code]},"
        f"{','.join(map(repr, more[:4]))},{flag[2]},{','.join(map(repr, more[4:]))}\n"
        for row, flag, code, more in zip(
            numbers, flags.astype(int).tolist(), codes, known, strict=True
        )
    )
    yield COLUMNS + "\n"
    yield from _joined(lines)


def _joined(lines: Iterator[str]) -> Iterator[str]:
    """Yield many lines at once: each part is one write to the disk."""
    while part := "".join(itertools.islice(lines, _LINES_AT_ONCE)):
        yield part
