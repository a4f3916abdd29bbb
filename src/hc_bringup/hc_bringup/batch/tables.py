"""The tables of a batch, gathered from the results one after the other, whatever their number.

The rows follow the recordings' names and the order of the variants, so the bytes are the same for
any number of workers.
"""

from __future__ import annotations

import collections
import csv
import io
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from hc_bringup.batch.variants import Variant
from hc_bringup.batch.work import ResultError, recording_units
from hc_bringup.report.contact_file import columns
from hc_bringup.sites import SITE
from hc_estimator import PARAMETER_NAMES
from hc_logger.new_file import new_file

RECORDINGS: Final = "recordings"
CONTACTS: Final = "contacts"
SITES: Final = "sites"
TOUCHES: Final = "contacts [1]"
_OF_A_SITE: Final = ("surface", "cov_", *PARAMETER_NAMES)
"""How the columns of a contact begin that are of its place."""
_ROWS_AT_ONCE: Final = 2000
_TEXTS: Final = ("recording", "sha256", "variant", "filter", "state_space", "contact_model")


@dataclass(frozen=True)
class Done:
    """One result in its place.

    Attributes:
        name: of the recording.
        content: SHA-256 of it; empty if it could not be read.
        size: its bytes.
        variant: how it was estimated.
        key: name of the result.
        result: as `work.read_result` gives it.
    """

    name: str
    content: str
    size: int
    variant: Variant
    key: str
    result: dict[str, Any]


def recording_rows(done: Done, swept: Sequence[str]) -> list[dict[str, Any]]:
    """Return the row of a result by column; a name ends in its unit in brackets."""
    row = _begin(done, swept)
    row["bytes [1]"] = done.size
    row["reason"] = done.result["reason"]
    for name, unit in recording_units().items():
        row[f"{name} [{unit}]"] = done.result["recording"].get(name)
    row["notes"] = "; ".join(done.result["notes"])
    row["estimates"] = done.result["estimates"]
    return [row]


def contact_rows(done: Done, swept: Sequence[str]) -> list[dict[str, Any]]:
    """Return the rows of a result's contacts, with the columns of hc contacts."""
    found = done.result["contacts"] | done.result["places"]
    begin = _begin(done, swept)
    count = len(next(iter(found.values()))) if found else 0
    return [begin | {name: values[i] for name, values in found.items()} for i in range(count)]


def site_rows(done: Done, swept: Sequence[str]) -> list[dict[str, Any]]:
    """Return a row for each place of a recording: what its last contact says, and how many."""
    touches = contact_rows(done, swept)
    counts = collections.Counter(row[SITE] for row in touches)
    last = {row[SITE]: row for row in touches}
    return [row | {TOUCHES: counts[site]} for site, row in last.items()]


def _begin(done: Done, swept: Sequence[str]) -> dict[str, Any]:
    configuration = done.variant.configuration
    values = (done.name, done.content, done.variant.label)
    values += tuple(configuration[name] for name in _TEXTS[3:])
    row: dict[str, Any] = dict(zip(_TEXTS, values, strict=True))
    return row | {f"sweep {name}": str(done.variant.swept[name]) for name in swept}


def table_columns(swept: Sequence[str], *, sites: bool) -> dict[str, dict[str, Any]]:
    """Return the columns of the tables: the kind of each (str, int or float) by name.

    Args:
        swept: names of what is swept.
        sites: whether each place was estimated by itself.
    """
    texts: dict[str, Any] = dict.fromkeys((*_TEXTS, *(f"sweep {name}" for name in swept)), str)
    whole = ("samples", "used", "in_contact", "rejected", "contacts", "changes")
    numbers = {
        f"{name} [{unit}]": int if name in whole else float
        for name, unit in recording_units().items()
    }
    counts = ("contact [1]", "samples [1]", "rejected [1]", "changes [1]")
    contacts = {name: int if name in counts else float for name in columns([])}
    recordings = {"bytes [1]": int, "reason": str, **numbers, "notes": str, "estimates": str}
    found = {RECORDINGS: texts | recordings, CONTACTS: texts | contacts}
    if sites:
        found[CONTACTS] |= {SITE: int}
        where = {SITE: int, TOUCHES: int, "x [mm]": float, "y [mm]": float}
        own = [name for name in contacts if name.startswith(_OF_A_SITE)]
        found[SITES] = texts | where | dict.fromkeys(own, float)
    return found


def write_csv(path: Path, names: Iterable[str], rows: Iterable[dict[str, Any]]) -> None:
    """Write a table as CSV; what is not known stays empty.

    Raises:
        ResultError: if it cannot be written.
    """
    names = list(names)
    try:
        with new_file(path, overwrite=True) as file:
            for part in _parts(rows):
                text = io.StringIO()
                writer = csv.writer(text, lineterminator="\n")
                if part is None:
                    writer.writerow(names)
                else:
                    writer.writerows([_cell(row[name]) for name in names] for row in part)
                file.write(text.getvalue().encode("utf-8", "surrogateescape"))
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror or error}") from error


def write_parquet(path: Path, kinds: dict[str, Any], rows: Iterable[dict[str, Any]]) -> None:
    """Write a table as Parquet.

    Raises:
        ImportError: if pyarrow is not installed.
        ResultError: if it cannot be written.
    """
    import pyarrow
    import pyarrow.parquet

    types = {str: pyarrow.string(), int: pyarrow.int64(), float: pyarrow.float64()}
    schema = pyarrow.schema([(name, types[kind]) for name, kind in kinds.items()])
    try:
        with (
            new_file(path, overwrite=True) as file,
            pyarrow.parquet.ParquetWriter(file, schema) as writer,
        ):
            for part in _parts(rows):
                table = {
                    name: [_value(row[name], kind) for row in part or ()]
                    for name, kind in kinds.items()
                }
                writer.write_table(pyarrow.table(table, schema=schema))
    except OSError as error:
        raise ResultError(f"cannot write {path}: {error.strerror or error}") from error


def _parts(rows: Iterable[dict[str, Any]]) -> Iterator[list[dict[str, Any]] | None]:
    """Yield nothing for the head, then the rows, some thousands at once."""
    yield None
    part: list[dict[str, Any]] = []
    for row in rows:
        part.append(row)
        if len(part) == _ROWS_AT_ONCE:
            yield part
            part = []
    if part:
        yield part


def _cell(value: Any) -> Any:
    return "" if value is None or (isinstance(value, float) and math.isnan(value)) else value


def _value(value: Any, kind: Any) -> Any:
    if value is None:
        return None
    if kind is str:
        return str(value).encode("utf-8", "backslashreplace").decode()
    return kind(value)
