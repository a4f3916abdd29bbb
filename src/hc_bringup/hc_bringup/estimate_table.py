"""The table of all estimates of a recording: what hc estimate -o and hc batch write.

As CSV, plain or compressed, or as Parquet: the same columns, the same numbers.
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import itertools
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_logger.compressions import BY_SUFFIX

PARQUET: Final = ".parquet"
SUFFIXES: Final = (".csv", *(f".csv{suffix}" for suffix in BY_SUFFIX), PARQUET)
_LINES_AT_ONCE = 4096
_BLOCKS_AT_ONCE = 16  # of lines in one row group of Parquet
COLUMNS = (
    "time_s,displacement_mm,force_N,stiffness [N/mm^n],damping [N(s/mm)^p/mm^n],"
    "displacement_exponent,velocity_exponent,stiffness_std [N/mm^n],"
    "damping_std [N(s/mm)^p/mm^n],displacement_exponent_std,velocity_exponent_std,"
    "force_predicted_N,force_reconstructed_N,nis,contact,change_detected,rejected,"
    "stiffness_identifiability,damping_identifiability,displacement_exponent_identifiability,"
    "velocity_exponent_identifiability,model_mismatch,channel_delay_s,"
    "channel_delay_std_s,contact_position_mm,contact_position_std_mm,force_zero_N,force_zero_std_N"
)


def check_new_table(path: Path) -> None:
    """See, before anything is computed, that a table of estimates can get this name.

    Raises:
        UserError: if it ends in nothing that is written, pyarrow is missing, or the file is there.
    """
    if not path.name.lower().endswith(SUFFIXES):
        raise UserError(f"{path} must end in {', '.join(SUFFIXES)}", WRONG_USE)
    if path.suffix.lower() == PARQUET and not has_pyarrow():
        raise UserError("writing .parquet needs pyarrow: pip install hc-suite[parquet]", FAILURE)
    if path.exists():
        raise UserError(f"{path} exists already: choose another file", WRONG_USE)


def has_pyarrow() -> bool:
    """Whether Parquet can be written here."""
    return importlib.util.find_spec("pyarrow") is not None


def write_estimates(path: Path, recording: Any, series: Any) -> None:
    """Write a new file of estimates, as its name ends.

    Raises:
        UserError: if it cannot be written.
    """
    from hc_logger.errors import BagError
    from hc_logger.new_file import failures_in_words, new_file

    lines = estimate_lines(recording, series)
    compression = BY_SUFFIX.get(path.suffix.lower())
    try:
        with failures_in_words(path), contextlib.ExitStack() as stack:
            file: Any = stack.enter_context(new_file(path))
            if path.suffix.lower() == PARQUET:
                write_parquet(file, lines)
                return
            if compression is not None and compression.opener is not None:
                file = stack.enter_context(compression.opener(file, "wb"))
            for part in lines:
                file.write(part.encode())
    except BagError as error:
        raise UserError(str(error)) from error


def write_parquet(file: Any, lines: Iterator[str]) -> None:
    """Write lines of CSV as Parquet: the same columns, the same numbers."""
    import pyarrow
    import pyarrow.csv
    import pyarrow.parquet

    names = next(lines).strip().split(",")
    kinds = {"contact": pyarrow.bool_(), "change_detected": pyarrow.bool_()}
    kinds["rejected"] = pyarrow.string()
    types = {name: kinds.get(name, pyarrow.float64()) for name in names}
    read = pyarrow.csv.ReadOptions(column_names=names, use_threads=False)
    convert = pyarrow.csv.ConvertOptions(column_types=types, null_values=[])
    with pyarrow.parquet.ParquetWriter(file, pyarrow.schema(list(types.items()))) as writer:
        while part := "".join(itertools.islice(lines, _BLOCKS_AT_ONCE)):
            table = pyarrow.csv.read_csv(
                io.BytesIO(part.encode()), read_options=read, convert_options=convert
            )
            writer.write_table(table)


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
