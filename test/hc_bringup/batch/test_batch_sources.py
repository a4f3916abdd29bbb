"""hc batch: which recordings a folder or a pattern names, each once, and what they are called."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from hc_bringup.batch import sources

EXAMPLE_BAG = Path(__file__).resolve().parents[3] / "bags" / "example"
MakeRecordings = Callable[..., Path]


def test_recordings_are_found_once_and_results_never(
    make_recordings: MakeRecordings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = make_recordings(2)
    (folder / "deeper").mkdir()
    (folder / "deeper" / "bag").symlink_to(EXAMPLE_BAG)
    (folder / "README.md").write_text("no recording")
    (folder / "out").mkdir()
    (folder / "out" / "contacts.csv").write_text("no recording either")
    (folder / "old.dat").write_text("")
    (folder / "other_batch" / "results").mkdir(parents=True)
    (folder / "other_batch" / "manifest.json").write_text("{}")
    (folder / "other_batch" / "contacts.csv").write_text("a result of another batch")
    monkeypatch.chdir(folder)

    def names(*patterns: str) -> list[str]:
        return sources.names_of(sources.find_recordings(patterns, folder / "out").recordings)

    assert names(str(folder)) == ["deeper/bag", "r0000.csv", "r0001.csv"]
    assert names("*", "r0000.csv", str(folder / "r0001.csv")) == names(".")
    assert names("*.dat") == ["old.dat"]
    assert names("**/r*1.csv") == ["r0001.csv"]
    mcap = next(EXAMPLE_BAG.glob("*.mcap")).name
    assert names("deeper/*", f"deeper/bag/{mcap}") == ["bag"]
    assert names(f"deeper/bag/{mcap}") == [mcap]


@pytest.mark.parametrize("links", [1, 3])
def test_links_that_go_round_double_nothing(
    make_recordings: MakeRecordings, tmp_path: Path, links: int
) -> None:
    """Regression: each recording came forty times; with two such links it never ended."""
    folder = make_recordings(2)
    (folder / "deeper").mkdir()
    (folder / "deeper" / "b.csv").symlink_to(folder / "r0000.csv")
    for number in range(links):
        (folder / "deeper" / f"up{number}").symlink_to("..")
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "c.csv").write_text("")
    (folder / "linked").symlink_to(tmp_path / "elsewhere")
    (folder / ".hidden").mkdir()
    (folder / ".hidden" / "d.csv").write_text("")
    wanted = [folder / name for name in ("deeper/b.csv", "linked/c.csv", "r0000.csv", "r0001.csv")]
    for pattern in ("**/*.csv", "**/**/*.csv", "**"):
        found = sources.find_recordings([f"{folder}/{pattern}"], tmp_path / "out").recordings
        assert [path for path in found if path.suffix] == wanted


@pytest.mark.parametrize("several", [False, True])
def test_no_name_is_a_formula_to_a_spreadsheet(tmp_path: Path, several: bool) -> None:
    """Regression: a recording called =HYPERLINK(...) was one when somebody opened the table."""
    paths = [tmp_path / "=1+1.csv"] + [tmp_path / name for name in ("-x.csv", "a=b.csv")] * several
    expected = ["./=1+1.csv", "./-x.csv", "a=b.csv"]
    assert sources.names_of(paths) == expected[: len(paths)]
