"""What `hc reproduce --quick` writes, and the page of the documentation against it."""

from __future__ import annotations

import csv
import json
import math
import re
from pathlib import Path

import pytest

from hc_evaluation.places import read_csv
from hc_evaluation.reproduction import ReproductionResult, available_experiments, load_experiment
from hc_evaluation.reproduction.page import experiment_page, markdown
from hc_evaluation.reproduction.tables import QUICK_BEGIN, QUICK_END, number, quick_numbers

pytestmark = pytest.mark.slow  # a whole campaign: two minutes

Campaign = tuple[ReproductionResult, list[tuple[str, int, int]]]

ROOT = Path(__file__).resolve().parents[2]
DOCUMENT = ROOT / "docs/reproduction.md"
PAGES = ROOT / "docs/evidence/reproduction"
CALM = 3.0
AGREEMENT = 0.1  # relative; another machine rounds differently, and filters amplify that


def _marked(text: str) -> dict[tuple[str, str], str]:
    """The marked section: printed number by experiment and column."""
    section = text[text.index(QUICK_BEGIN) : text.index(QUICK_END)]
    rows = re.findall(r"^\| (\w+) \| (.+?) \| (\S+) \|$", section, re.MULTILINE)
    return {(name, column): value for name, column, value in rows}


def test_the_page_says_where_its_figures_come_from(quick_campaign: Campaign) -> None:
    said = re.compile(r"^`hc reproduce [^`]+`, hc \S+ \(commit \w+", re.MULTILINE)
    assert said.search(DOCUMENT.read_text(encoding="utf-8"))
    origin = "`hc reproduce -o x`, hc 1.2.3 (commit 1a2b3c4), 2026-11-23."
    assert f"on only.\n\n{origin}\n\nThe papers' claims" in markdown(quick_campaign[0], origin)
    assert "on only.\n\nThe papers' claims" in markdown(quick_campaign[0])
    for name, entry in quick_campaign[0].experiments.items():
        assert said.search((PAGES / f"{name}.md").read_text(encoding="utf-8"))
        assert f"\n\n{origin}\n\nPaper " in experiment_page(entry, origin)


@pytest.mark.slow
def test_the_page_says_what_the_quick_command_finds(quick_campaign: Campaign) -> None:
    printed = _marked(DOCUMENT.read_text(encoding="utf-8"))
    found = {
        (name, column): value
        for name, entry in quick_campaign[0].experiments.items()
        for column, value in quick_numbers(entry).items()
    }
    assert set(printed) == set(found)
    wrong = []
    for (name, column), text in printed.items():
        if load_experiment(name).column(column).setting == "paper":
            continue  # without guards they may be chaotic, and differ between machines
        value = found[name, column]
        seeds = quick_campaign[0].experiments[name].columns[column]["force_rmse"]
        if not max(seeds) < CALM * min(seeds):
            continue  # it now and then loses the tissue: which seed does is a matter of rounding
        if text == "fails":
            agrees = not value < 1e6
        else:
            agrees = math.isclose(float(text), value, rel_tol=AGREEMENT)
        if not agrees:
            wrong.append(f"{name}, {column}: page {text}, now {value:.4g}")
    assert not wrong, (
        "docs/reproduction.md is out of date; make it anew with `hc reproduce -o DIR` and copy "
        "what stands in DIR to docs: " + "; ".join(wrong)
    )


def test_the_page_is_whole(quick_campaign: Campaign) -> None:
    result = quick_campaign[0]
    page = (result.output / "reproduction.md").read_text(encoding="utf-8")
    assert page.index("| experiment | claim") < page.index("\n## ")
    pictures: list[str] = []
    for name in available_experiments():
        experiment = load_experiment(name)
        assert f"(evidence/reproduction/{name}.md)" in page
        file = result.output / "evidence" / "reproduction" / f"{name}.md"
        section = file.read_text(encoding="utf-8")
        pictures += re.findall(r"\]\(\.\./\.\./(pictures/[^)]+)\)", section)
        said, rows = read_csv(file.with_suffix(".csv"))
        assert said
        assert rows[0] == ("score", *(column.name for column in experiment.columns))
        assert "| " + " | ".join(rows[-1]) + " |" in section
        for column in experiment.columns:
            assert column.name in section
        for row in (
            "failure rate",
            "hold-forward",
            "one step ahead",
            "as reported, RMSE",
            "law at",
        ):
            assert row in section or name == "c_table_3"
        for what in experiment.readings:
            assert f"- {what}: " in section
    for said in (
        "Counted by the law at the parameters",
        "Counted by hold-forward",
        "Left out of both counts",
        "Not to the letter in the columns **paper**",
        "**Which force is scored.**",
        "The noise figures read the other way",
    ):
        assert said in page
    assert len(pictures) == 4 + 11 + 4
    for picture in pictures:
        assert (result.output / picture).stat().st_size > 10_000
    assert set(_marked(page)) == set(_marked(DOCUMENT.read_text(encoding="utf-8")))


def test_the_documents_pictures_are_there() -> None:
    pages = {path.stem: path.read_text(encoding="utf-8") for path in PAGES.glob("*.md")}
    assert set(pages) == set(available_experiments())
    for page in pages.values():
        for picture in re.findall(r"\]\(([./]*pictures/[^)]+)\)", page):
            assert (PAGES / picture).is_file(), picture


def test_tables_and_results_say_the_same(quick_campaign: Campaign) -> None:
    result = quick_campaign[0]
    with (result.output / "reproduction.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    stored = json.loads((result.output / "reproduction.json").read_text(encoding="utf-8"))
    assert len(rows) == len(stored["summary"])
    chosen = [
        r
        for r in rows
        if (r["experiment"], r["column"], r["score"])
        == ("a_table_1", "RWSTUKF, paper", "force_rmse")
    ]
    assert len(chosen) == 1
    assert float(chosen[0]["published"]) == 2.9133
    values = stored["experiments"]["a_table_1"]["columns"]["RWSTUKF, paper"]["force_rmse"]
    assert float(chosen[0]["median"]) == pytest.approx(sorted(values)[1])
    assert {Path(f).name for f in result.files} >= {
        "reproduction.md",
        "reproduction.csv",
        "reproduction.json",
    }


def test_progress_is_told_seed_by_seed(quick_campaign: Campaign) -> None:
    told = quick_campaign[1]
    for name in available_experiments():
        steps = [(done, total) for what, done, total in told if what == name]
        assert steps[0] == (0, 3)
        assert steps[-1] == (3, 3)
        assert steps == sorted(steps)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (float("nan"), "–"),
        (float("inf"), "diverges"),
        (1234.5, "1234"),
        (3.56e8, "3.6e+08"),
        (12.345, "12.3"),
        (0.0123456, "0.0123"),
        (0.00012345, "1.23e-04"),
        (0.0, "0.00"),
    ],
)
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert number(value) == text
