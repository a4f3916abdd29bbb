"""The evidence: every measured table says where it comes from, stands as CSV, and is not outlived.

`slow`: each benchmark that fills a table runs again with one seed and is held against what one seed
gave when the table was made. A page that is older than what it describes fails here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import pytest

from hc_evaluation.accuracy.run import EXPERIMENTS, run_accuracy
from hc_evaluation.accuracy.table import SUMMARY, markdown_tables, summary
from hc_evaluation.places import (
    FIRST_SEED,
    Place,
    check_places,
    csv_path,
    evidence_of,
    keep_first_seed,
    places_of,
    read_csv,
    write_place,
)
from hc_evaluation.teleoperation import effort, impedance
from hc_evaluation.teleoperation.bench import run_teleoperation
from hc_evaluation.teleoperation.table import markdown_table

DOCS = Path(__file__).resolve().parents[2] / "docs"
ACCURACY, TELEOPERATION = DOCS / "accuracy.md", DOCS / "teleoperation.md"
ORIGIN = re.compile(
    r"`hc bench [^`]+`, hc [\d.]+ \(commit [0-9a-f]{7,}(?:, changed)?\), 20\d\d-\d\d-\d\d\."
)
PLACES = [(page, place) for page in (ACCURACY, TELEOPERATION) for place in places_of(page)]
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
CALM = 0.1  # relative; another machine rounds differently, and some of the filters amplify that
SHARE = 0.05  # of a table's numbers that may be off by more: single runs that turn on a rounding

Rows = Sequence[Sequence[str]]


def named(case: object) -> str:
    return case.name if isinstance(case, Place) else ""


@pytest.mark.parametrize(("document", "place"), PLACES, ids=named)
def test_every_table_says_command_and_commit_and_stands_as_csv(
    document: Path, place: Place
) -> None:
    assert place.tables, "an empty place"
    assert ORIGIN.search(place.said), place.said
    if place.name == SUMMARY:
        return
    for rows in place.tables:
        suffix = "targets" if rows[0][0] == "target" else ""
        assert read_csv(csv_path(document, place.name, suffix)) == (place.said, rows)


MEASURED = (
    "../README.md",
    "batch.md",
    "estimators.md",
    "evidence/performance.md",
    "guide/looking.md",
    "performance.md",
    "reliability.md",
    "reproduction.md",
)
SETTINGS = {
    "estimators.md": ["Which filter", "Parameters"],
    "guide/looking.md": ["Foxglove, Lichtblick, PlotJuggler"],
}
"""Their tables of what there is, with numbers that nobody measured."""
COMMIT = re.compile(r"\bcommit [0-9a-f]{7,}\b")


def tables_without_a_commit(text: str) -> list[str]:
    """Headings above a table with figures, where neither they nor the page's head name a commit."""
    head, *sections = re.split(r"^## ", text, flags=re.MULTILINE)
    if COMMIT.search(head):
        return []
    figures = re.compile(r"^\|[ :|-]*---[ :|-]*\n(?:\|.*\n)*?\|.*\d", re.MULTILINE)
    return [
        part.partition("\n")[0]
        for part in sections
        if figures.search(part) and not COMMIT.search(part)
    ]


@pytest.mark.parametrize("page", MEASURED)
def test_what_was_measured_by_hand_names_the_commit(page: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    assert tables_without_a_commit(text) == SETTINGS.get(page, [])


@pytest.mark.parametrize(
    "page", ["README.md", "docs/evidence/index.md", "docs/evidence/performance.md"]
)
def test_pages_that_repeat_the_accuracy_repeat_the_table(page: str) -> None:
    """Regression: the ranges on the first page were those of a filter of two days before."""
    columns, *rows = read_csv(evidence_of(ACCURACY) / "tissues.csv")[1]
    text = (DOCS.parent / page).read_text(encoding="utf-8")
    for name in ("over bound", "NEES", "NIS"):
        values = [word for row in rows for word in row[columns.index(name)].split()]
        said = f"{min(values, key=float)} to {max(values, key=float)}"
        assert said in text or (name == "NIS" and page.endswith("index.md")), (name, said)


def test_a_table_without_a_commit_is_seen() -> None:
    table = "| a | b |\n|---|---|\n| x | 1.2 |\n"
    assert tables_without_a_commit(f"head\n## one\n{table}") == ["one"]
    assert not tables_without_a_commit(f"head\n## one\n{table}(commit 0123abc)\n")
    assert not tables_without_a_commit(f"by commit 0123abc\n## one\n{table}")


def test_no_csv_is_left_of_a_table_that_is_gone() -> None:
    for document in (ACCURACY, TELEOPERATION):
        kept = {
            csv_path(document, place.name, suffix)
            for _, place in PLACES
            for suffix in ("", "targets", FIRST_SEED)
        }
        assert set(evidence_of(document).glob("*.csv")) <= kept


def test_every_experiment_with_targets_has_a_page_and_a_line_of_the_conclusions() -> None:
    pages = {name for name, e in EXPERIMENTS.items() if not e.by_name_only}
    assert {path.stem for path in evidence_of(ACCURACY).glob("*.md")} >= pages
    (place,) = (place for _, place in PLACES if place.name == SUMMARY)
    rows = [line.split(" | ") for line in summary(ACCURACY).splitlines()]
    assert len(rows) == len(pages) + 2
    assert [row[0] for row in place.tables[0][1:]] == [row[0].strip("| ") for row in rows[2:]]
    assert [row[2] for row in place.tables[0][1:]] == [row[2].strip("| ") for row in rows[2:]]


def test_a_place_is_filled_in_the_page_that_has_it(tmp_path: Path) -> None:
    document = tmp_path / "page.md"
    document.write_text("no place here\n")
    single = (evidence_of(document) / "one").with_suffix(".md")
    single.parent.mkdir(parents=True)
    single.write_text("before\n<!-- page one -->\nold\n<!-- end -->\nafter\n")
    table = "| a | b |\n| --- | --- |\n| 1, 2 |  |"
    write_place(document, "page one", "Said.", {"": table, "targets": table})
    assert document.read_text() == "no place here\n"
    assert "old" not in single.read_text()
    (place,) = places_of(document)
    assert place == Place(single, "page one", "Said.", ((("a", "b"), ("1, 2", "")),) * 2)
    for name in ("one.csv", "one_targets.csv"):
        assert read_csv(single.parent / name) == ("Said.", place.tables[0])
    keep_first_seed(document, "page one", "One.", table)
    assert read_csv(single.parent / "one_first_seed.csv") == ("One.", place.tables[0])
    with pytest.raises(ValueError, match="no lines <!-- page two -->"):
        check_places(document, "page one", "page two")


def far_off(before: Rows, now: Rows) -> list[str]:
    """Cells whose numbers differ by more than a tenth, or whose words differ."""
    found = []
    for old, new in zip(before, now, strict=True):
        for heading, was, becomes in zip(before[0], old, new, strict=True):
            numbers = [[float(x) for x in NUMBER.findall(cell)] for cell in (was, becomes)]
            words = [NUMBER.sub("", cell) for cell in (was, becomes)]
            same = words[0] == words[1] and numbers[0] == pytest.approx(
                numbers[1], rel=CALM, abs=1e-12
            )
            if not same:
                found.append(f"{new[0]}, {heading}: page {was}, now {becomes}")
    return found


def hold(document: Path, name: str, table: str) -> None:
    """A table of one seed against the one that was kept."""
    _, before = read_csv(csv_path(document, name, FIRST_SEED))
    now = [[c.strip() for c in line.strip()[1:-1].split("|")] for line in table.splitlines()]
    del now[1]
    assert [len(row) for row in now] == [len(row) for row in before]
    found = far_off(before, now)
    assert len(found) <= SHARE * sum(map(len, before)), (
        f"{name} of {document.name} is older than what it describes: measure it anew "
        f"(`hc bench ... --document`). {'; '.join(found)}"
    )


def test_what_is_off_is_seen() -> None:
    before = (("name", "x"), ("a", "1.00 2.0e-05 ± 3 %"), ("b", "never"))
    assert not far_off(before, (before[0], ("a", "1.05 2.1e-05 ± 3 %"), before[2]))
    assert far_off(before, (before[0], ("a", "1.00 2.5e-05 ± 3 %"), before[2]))
    assert far_off(before, (*before[:2], ("b", "0.5")))


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", [n for n, e in EXPERIMENTS.items() if not e.by_name_only])
def test_the_accuracy_pages_are_not_older_than_the_filter(name: str) -> None:
    experiment = run_accuracy([name], 1)["experiments"][name]
    if "skipped" in experiment:
        pytest.skip(experiment["skipped"])
    hold(ACCURACY, f"accuracy {name}", markdown_tables(name, experiment)[""])


AGAIN = {
    "teleoperation": lambda: {"teleoperation": markdown_table(run_teleoperation(quick=True))},
    "impedance": lambda: {"impedance": impedance.text_table(impedance.run_impedance(quick=True))},
    "effort": lambda: effort.markdown_tables(effort.run_effort(quick=True)),
}


@pytest.mark.slow
@pytest.mark.timeout(1200)
@pytest.mark.parametrize("name", AGAIN)
def test_the_teleoperation_page_is_not_older_than_what_it_describes(name: str) -> None:
    if not csv_path(TELEOPERATION, name, FIRST_SEED).is_file():
        pytest.skip(f"one seed is kept by hc bench {name} --document docs/teleoperation.md")
    for place, table in AGAIN[name]().items():
        hold(TELEOPERATION, place, table)
