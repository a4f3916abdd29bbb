"""Places of measured tables in the documents, and the same tables as CSV beside them.

A table stands between `<!-- NAME -->` and `<!-- end -->`: in the document itself, or in one of the
pages of its evidence, `evidence/DOCUMENT/*.md` beside it. The sentence above the table says what
gave it: seeds, command, commit, day. The CSV stands in the same folder, with that sentence as a
comment in its first line.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

END = "<!-- end -->"
FIRST_SEED = "first_seed"
"""Added to the name of a CSV: what one seed gives."""
_PLACE = re.compile(r"^<!-- ([^>\n]+) -->\n(.*?)^<!-- end -->$", re.DOTALL | re.MULTILINE)
_COMMENT = re.compile(r"^<!-- ([^>\n]+) -->$", re.MULTILINE)
_RULE = re.compile(r"[-: ]+")


@dataclass(frozen=True)
class Place:
    """A table's place as it is filled now.

    Attributes:
        page: the Markdown file that it stands in.
        name: its name.
        said: the sentence on seeds, command, commit and day; empty where nothing was measured yet.
        tables: rows of cells of each table, the headings first.
    """

    page: Path
    name: str
    said: str
    tables: tuple[tuple[tuple[str, ...], ...], ...]


def evidence_of(document: Path) -> Path:
    """The folder of a document's evidence: pages of single experiments, and tables as CSV."""
    return document.parent / "evidence" / document.stem


def pages_of(document: Path) -> tuple[Path, ...]:
    """The document, and the pages of its evidence."""
    return document, *sorted(evidence_of(document).glob("*.md"))


def places_of(document: Path) -> Iterator[Place]:
    """Every place of a document and of its evidence.

    Raises:
        OSError: a page cannot be read.
    """
    for page in pages_of(document):
        for name, body in _PLACE.findall(page.read_text(encoding="utf-8")):
            said, _, rest = body.partition("\n\n")
            yield Place(page, name, said.strip(), tuple(_tables(rest)))


def names_of(document: Path) -> set[str]:
    """What may be the name of a place: every comment of a document and of its evidence.

    Raises:
        OSError: a page cannot be read.
    """
    texts = (page.read_text(encoding="utf-8") for page in pages_of(document))
    return {name for text in texts for name in _COMMENT.findall(text)}


def check_places(document: Path, *names: str) -> None:
    """Look for places before hours of measuring.

    Raises:
        OSError: a page cannot be read.
        ValueError: there is no place of one of the names, or it has no end.
    """
    for name in names:
        _page_with(document, name)


def write_place(document: Path, name: str, said: str, tables: Mapping[str, str]) -> None:
    """Replace what stands in a place, and write its tables as CSV.

    Args:
        document: it, or a page of its evidence, has the place; written in place.
        name: of the place.
        said: how the tables were measured: seeds, command, commit, day.
        tables: tables in Markdown, by what is added to the name of the CSV (nothing for the first).

    Raises:
        OSError: a file cannot be read or written.
        ValueError: there is no such place.
    """
    page = _page_with(document, name)
    before, _, rest = page.read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")
    _, _, after = rest.partition(END)
    body = "\n\n".join(tables.values())
    text = f"{before}<!-- {name} -->\n{said}\n\n{body}\n{END}{after}"
    page.write_text(text, encoding="utf-8")
    for suffix, table in tables.items():
        rows = next(_tables(table), None)
        if rows is not None:
            write_csv(csv_path(document, name, suffix), said, rows)


def csv_path(document: Path, name: str, suffix: str = "") -> Path:
    """Where a place's table stands as CSV."""
    plain = re.sub(r"\W+", "_", name.removeprefix(f"{document.stem} "))
    return evidence_of(document) / f"{plain}{f'_{suffix}' if suffix else ''}.csv"


def keep_first_seed(document: Path, name: str, said: str, table: str) -> None:
    """Keep what a run of one seed gives, for the test that tells when a page has grown too old.

    Args:
        document: whose evidence it is.
        name: of the place whose table it repeats.
        said: command, commit, day.
        table: in Markdown.

    Raises:
        OSError: the file cannot be written.
    """
    for rows in _tables(table):
        write_csv(csv_path(document, name, FIRST_SEED), said, rows)


def write_csv(path: Path, said: str, rows: tuple[tuple[str, ...], ...]) -> None:
    """Write a table's cells; the first line is a comment that says where they come from.

    Raises:
        OSError: it cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    text = io.StringIO()
    text.write(f"# {said}\n")
    csv.writer(text, lineterminator="\n").writerows(rows)
    path.write_text(text.getvalue(), encoding="utf-8")


def read_csv(path: Path) -> tuple[str, tuple[tuple[str, ...], ...]]:
    """Where a table comes from, and its cells.

    Raises:
        OSError: it cannot be read.
    """
    said, _, rest = path.read_text(encoding="utf-8").partition("\n")
    return said.removeprefix("# "), tuple(tuple(row) for row in csv.reader(io.StringIO(rest)))


def _page_with(document: Path, name: str) -> Path:
    for page in pages_of(document):
        _, start, rest = page.read_text(encoding="utf-8").partition(f"<!-- {name} -->\n")
        if start and END in rest:
            return page
        if start:
            raise ValueError(f"{page}: no line {END} after <!-- {name} -->")
    folder = evidence_of(document)
    raise ValueError(f"there are no lines <!-- {name} --> and {END} in {document} or in {folder}")


def _tables(text: str) -> Iterator[tuple[tuple[str, ...], ...]]:
    """Cells of each Markdown table in a text, without the rule below the headings."""
    for part in re.split(r"\n\s*\n", text):
        lines = [line for line in part.splitlines() if line.startswith("|")]
        rows = [tuple(cell.strip() for cell in line.strip()[1:-1].split("|")) for line in lines]
        kept = tuple(row for row in rows if not all(_RULE.fullmatch(cell) for cell in row))
        if kept:
            yield kept
