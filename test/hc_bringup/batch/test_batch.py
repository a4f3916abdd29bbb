"""hc batch: the rows of hc contacts and hc estimate, whatever is broken, interrupted or shared."""

from __future__ import annotations

import csv
import json
import os
import random
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from hc_bringup.batch import campaign, engines, software, tables
from hc_bringup.batch.work import analyse, result_path
from hc_bringup.cli import main

EXAMPLE_BAG = Path(__file__).resolve().parents[3] / "bags" / "example"
MakeRecordings = Callable[..., Path]


def batch(*words: object) -> int:
    return main(["batch", *map(str, words), "--filter", "ukf", "-j", "1"])


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def contents(folder: Path) -> dict[str, bytes]:
    files = sorted(p for p in folder.rglob("*") if p.is_file())
    return {p.relative_to(folder).as_posix(): p.read_bytes() for p in files}


def summary(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_rows_are_those_of_hc_contacts_and_hc_estimate(
    make_recordings: MakeRecordings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The single commands are the oracle, for CSV files and for a bag."""
    folder, target = make_recordings(2), tmp_path / "out"
    (folder / "bag").symlink_to(EXAMPLE_BAG)
    assert batch(folder, "-o", target) == 0
    found = rows(target / "recordings.csv")
    assert [row["recording"] for row in found] == ["bag", "r0000.csv", "r0001.csv"]
    contacts = rows(target / "contacts.csv")
    for row in found:
        recording = folder / row["recording"]
        capsys.readouterr()
        assert main(["estimate", str(recording), "--filter", "ukf", "--json"]) == 0
        expected = summary(capsys)
        assert float(row["nis_mean [1]"]) == expected["nis_mean"]
        assert int(row["samples [1]"]) == expected["samples"]
        assert float(row["stiffness [N/mm^n]"]) == expected["parameters"]["stiffness"]
        assert float(row["damping_std [N(s/mm)^p/mm^n]"]) == expected["parameters_std"]["damping"]
        assert row["reason"] == ""
        single = tmp_path / f"{recording.name}.contacts.csv"
        assert main(["contacts", str(recording), "--filter", "ukf", "-o", str(single)]) == 0
        mine = [r for r in contacts if r["recording"] == row["recording"]]
        theirs = rows(single)
        assert len(mine) == len(theirs) == int(row["contacts [1]"]) > 0
        for one, other in zip(mine, theirs, strict=True):
            assert {name: one[name] for name in other} == other


def test_broken_recordings_are_rows_with_a_reason(
    make_recordings: MakeRecordings,
    break_some: Callable[[Path], int],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder, target = make_recordings(2), tmp_path / "out"
    broken = break_some(folder) + 2
    os.mkfifo(folder / "pipe.csv")
    (folder / "device.mcap").symlink_to("/dev/zero")
    assert batch(folder, "-o", target, "--json") == 0
    told = summary(capsys)
    assert (told["recordings"], told["without_result"]) == (2 + broken, broken)
    assert (told["results"], told["made"], told["kept"]) == (2, 2, 0)
    assert batch(folder, "-o", target, "--resume") == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"9 recordings: 0 results made, 2 kept, {broken} without a result, ")
    found = {row["recording"]: row for row in rows(target / "recordings.csv")}
    assert "is empty" in found["empty.csv"]["reason"]
    assert "line 3" in found["cut.csv"]["reason"]
    assert "no contact in 99 samples" in found["air.csv"]["reason"]
    assert found["air.csv"]["samples [1]"] == "99"
    assert all(found[name]["reason"] for name in ("words.csv", "noise.mcap"))
    assert all(str(tmp_path) not in row["reason"] for row in found.values())
    assert all("no file" in found[name]["reason"] for name in ("pipe.csv", "device.mcap"))
    assert not found["r0000.csv"]["reason"]
    page = (target / "overview.html").read_text()
    assert "no contact in 99 samples" in page


def test_a_recording_that_only_some_variants_can_use_says_which(
    make_recordings: MakeRecordings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: it was counted among the results made, and said to have none at all."""
    folder, target = make_recordings(1), tmp_path / "out"
    (folder / "empty.csv").write_text("")
    head, *lines = (folder / "r0000.csv").read_text().splitlines()
    pushed = (f"{t},{d},{float(f) + 0.5}" for t, d, f in map(cells, lines))
    (folder / "r0000.csv").write_text("\n".join([head, *pushed]) + "\n")
    sweep = ("--sweep", "force_limit=0.001,50")
    assert batch(folder, "-o", target, *sweep) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first.startswith("2 recordings through 2 variants: 1 result made, 0 kept, 3 without a")
    said = [line for line in lines if line.startswith("without a result: ")]
    assert [line.split(":")[1] for line in said] == [" empty.csv", " r0000.csv, force_limit=0.001"]


def test_a_recording_that_is_read_wrongly_has_a_reason_and_no_parameters(
    make_recordings: MakeRecordings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: K = 6e-7 of an arm whose axes point down stood in the table as a result."""
    folder, target = make_recordings(3, seconds=6.0), tmp_path / "out"
    path = folder / "r0001.csv"
    head, *lines = path.read_text().splitlines()
    turned = (f"{t},{200.0 - float(d)},{-float(f)}" for t, d, f in map(cells, lines))
    path.write_text("\n".join([head, *turned]) + "\n")
    assert batch(folder, "-o", target, "--json") == 0
    assert summary(capsys)["without_result"] == 1
    good, turned_row, _other = rows(target / "recordings.csv")
    assert good["reason"] == ""
    assert turned_row["reason"] == (
        "these are not the parameters of the tissue, for the sign of a channel is wrong"
    )
    assert "turn the signs of both" in turned_row["notes"]
    names = [name for name in good if name.startswith(("stiffness", "damping"))]
    assert len(names) == 6
    assert all(good[name] and not turned_row[name] for name in names)
    assert {row["recording"] for row in rows(target / "contacts.csv")} == {"r0000.csv", "r0002.csv"}
    assert "the sign of a channel is wrong" in (target / "overview.html").read_text()


def cells(line: str) -> list[str]:
    return line.split(",")


def test_resume_makes_only_what_is_missing_changed_or_damaged(
    make_recordings: MakeRecordings,
    call_it_another_study: Callable[[Path], None],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder, target = make_recordings(3), tmp_path / "out"

    def again(*words: object) -> tuple[int, int]:
        assert batch(folder, "-o", target, "--resume", "--json", *words) == 0
        told = summary(capsys)
        return told["made"], told["kept"]

    assert again() == (3, 0)
    first = contents(target)
    assert again() == (0, 3)
    assert contents(target) == first
    (folder / "r0001.csv").rename(folder / "other_name.csv")  # the same content
    assert again() == (0, 3)
    text = (folder / "r0000.csv").read_text()
    (folder / "r0000.csv").write_text(text[: text.rindex("\n", 0, -1) + 1])
    assert again() == (1, 2)
    assert again("--sweep", "force_noise_std=0.02,0.03") == (3, 3)  # 0.02 is the usual one
    call_it_another_study(target)
    assert again("--param", "force_noise_std=0.04") == (3, 0)
    call_it_another_study(target)
    assert again("--minimum-depth", "0.5") == (3, 0)
    manifest = json.loads((target / "manifest.json").read_text())
    key = manifest["recordings"][0]["results"][0]
    whole = result_path(target, key).read_bytes()
    result_path(target, key).write_bytes(whole[:-9])
    assert again("--minimum-depth", "0.5") == (1, 2)
    assert result_path(target, key).read_bytes() == whole
    assert again("--minimum-depth", "0.5", "--estimates") == (3, 0)
    next((target / "estimates").rglob("*.csv")).unlink()
    assert again("--minimum-depth", "0.5", "--estimates") == (1, 2)


def test_recordings_with_the_same_content_are_named(
    make_recordings: MakeRecordings, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Each was a row of the table, and nothing said that a mean counts one twice."""
    folder = make_recordings(3)
    assert batch(folder, "-o", tmp_path / "out") == 0
    assert "with the content of another" not in capsys.readouterr().out
    (folder / "day2").mkdir()
    for name in ("copy.csv", "day2/r0001.csv"):
        (folder / name).write_bytes((folder / "r0001.csv").read_bytes())
    (folder / "empty.csv").touch()
    (folder / "empty_too.csv").touch()
    assert batch(folder, "-o", tmp_path / "out", "--resume") == 0
    said = capsys.readouterr().out
    same = ["copy.csv", "day2/r0001.csv", "r0001.csv"]
    assert f"2 recordings with the content of another, and counted each: {' = '.join(same)}" in said
    assert batch(folder, "-o", tmp_path / "out", "--resume", "--json") == 0
    assert summary(capsys)["copies"] == [same]


def test_bytes_do_not_depend_on_order_shares_or_interruptions(
    make_recordings: MakeRecordings,
    break_some: Callable[[Path], int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder = make_recordings(3)
    total = 2 * (3 + break_some(folder))
    words = (folder, "--sweep", "force_noise_std=0.002,0.02", "--estimates", "-o")
    assert batch(*words, tmp_path / "plain") == 0

    def shuffled(tasks: Any, _workers: int) -> Iterator[Any]:
        chosen = list(tasks)
        random.Random(4).shuffle(chosen)
        yield from map(analyse, chosen)

    def interrupted(tasks: Any, workers: int) -> Iterator[Any]:
        for number, answer in enumerate(shuffled(tasks, workers)):
            if number == 5:
                raise KeyboardInterrupt
            yield answer

    share = campaign.Campaign.tasks
    monkeypatch.setattr(campaign.Campaign, "tasks", lambda self, _workers: share(self, 64))
    monkeypatch.setattr(engines, "here", interrupted)
    capsys.readouterr()
    assert batch(*words, tmp_path / "other") == 130
    told = capsys.readouterr().out
    assert f"ended early with 5 of {total}" in told
    assert "--resume" in told
    assert len(rows(tmp_path / "other" / "recordings.csv")) == 5
    assert not json.loads((tmp_path / "other" / "manifest.json").read_text())["complete"]
    assert "Not complete" in (tmp_path / "other" / "overview.html").read_text()
    monkeypatch.setattr(engines, "here", shuffled)
    assert batch(*words, tmp_path / "other", "--resume") == 0
    assert contents(tmp_path / "other") == contents(tmp_path / "plain")


def test_an_interrupt_while_the_tables_are_gathered_says_how_to_go_on(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    folder, target = make_recordings(3), tmp_path / "out"
    assert batch(folder, "-o", tmp_path / "plain") == 0
    whole = tables.write_csv

    def interrupted(path: Path, *rest: Any) -> None:
        if path.name == "contacts.csv":
            raise KeyboardInterrupt
        whole(path, *rest)

    monkeypatch.setattr(tables, "write_csv", interrupted)
    capsys.readouterr()
    assert batch(folder, "-o", target) == 130
    told = capsys.readouterr()
    assert told.out == ""
    assert told.err.splitlines()[-1] == (
        "hc batch: ended while the tables were gathered: 3 of 3 results are kept, --resume goes on"
    )
    monkeypatch.setattr(tables, "write_csv", whole)
    assert batch(folder, "-o", target, "--resume") == 0
    assert "0 results made, 3 kept" in capsys.readouterr().out
    assert contents(target) == contents(tmp_path / "plain")


def test_sweep_runs_every_combination(make_recordings: MakeRecordings, tmp_path: Path) -> None:
    folder, target = make_recordings(2), tmp_path / "out"
    sweeps = ("--sweep", "filter=ekf,ukf", "--sweep", "force-noise-std=0.002,2e-2")
    assert main(["batch", str(folder), "-o", str(target), "-j", "1", *sweeps]) == 0
    found = rows(target / "recordings.csv")
    assert len(found) == 8
    assert [(row["sweep filter"], row["sweep force_noise_std"]) for row in found[:4]] == [
        ("ekf", "0.002"),
        ("ekf", "0.02"),
        ("ukf", "0.002"),
        ("ukf", "0.02"),
    ]
    assert [row["filter"] for row in found[:4]] == ["ekf", "ekf", "ukf", "ukf"]
    one, other = (json.loads((target / "manifest.json").read_text())["variants"][i] for i in (0, 1))
    assert one["parameters"]["force_noise_std"] == 0.002
    assert other["parameters"]["force_noise_std"] == 0.02
    assert len({row["nis_mean [1]"] for row in found[:4]}) > 1


def test_parquet_holds_what_csv_holds(make_recordings: MakeRecordings, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    folder, target = make_recordings(2), tmp_path / "out"
    (folder / "bad.csv").write_text("no\n")
    assert batch(folder, "-o", target, "--estimates", "parquet") == 0
    for name in ("recordings", "contacts"):
        table = parquet.read_table(target / f"{name}.parquet").to_pylist()
        texts = rows(target / f"{name}.csv")
        assert len(table) == len(texts) > 0
        for one, other in zip(table, texts, strict=True):
            assert list(one) == list(other)
            for column, value in one.items():
                told = other[column]
                assert told == "" if value is None or value != value else told == str(value)
    name = next(row["estimates"] for row in rows(target / "recordings.csv") if row["estimates"])
    single = tmp_path / "single.csv"
    assert main(["estimate", str(folder / "r0000.csv"), "--filter", "ukf", "-o", str(single)]) == 0
    table = parquet.read_table(target / name).to_pylist()
    texts = rows(single)
    assert len(table) == len(texts) == 800
    for one, other in zip(table, texts, strict=True):
        assert one["stiffness [N/mm^n]"] == float(other["stiffness [N/mm^n]"])
        assert one["contact"] == (other["contact"] == "1")
        assert one["rejected"] == other["rejected"]


def test_wrong_use_is_one_line(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    folder, target = make_recordings(1), tmp_path / "out"
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    good = (str(folder), "-o", str(target))
    for words, says in (
        ((str(folder / "none*.csv"), "-o", str(target)), "names no recording"),
        ((str(folder / "none"), "-o", str(target)), "none does not exist"),
        ((str(folder), "-o", str(folder)), "is in the folder of the results: choose another one"),
        ((str(folder), "-o", str(tmp_path / "full")), "holds something else"),
        ((str(folder), "-o", str(tmp_path / "full"), "--resume"), "holds something else"),
        ((str(folder), "-o", str(tmp_path / "full" / "thesis.tex")), "is a file"),
        ((*good, "--sweep", "noise=1,2"), "noise"),
        ((*good, "--sweep", "filter=ukf,magic"), "filter=magic"),
        ((*good, "--sweep", "filter=ukf,ukf"), "twice"),
        ((*good, "--sweep", "filter"), "NAME=VALUE"),
        ((*good, "--filter", "ukf", "--sweep", "filter=ekf,ukf"), "given twice"),
        ((*good, "--sweep", "filter=ukf", "--sweep", "filter=ekf"), "given twice"),
        ((*good, "--input", "force.magic=1"), "force.magic"),
        ((*good, "-j", "2", "--local-cluster", "2"), "-j is for this machine alone"),
        ((*good, "--local-cluster", "0"), "1 or more"),
        ((*good, "--local-cluster", "2", "--scheduler", "tcp://a:1"), "not allowed with"),
        ((*good, "-j", "100000"), "more than 1024"),
    ):
        try:
            status = main(["batch", *words])
        except SystemExit as end:
            status = int(str(end.code))
        assert status in (1, 2), words
        told = capsys.readouterr().err
        assert says in told, words
        assert told.count("\n") == 1, told
    assert not target.exists()
    monkeypatch.setitem(sys.modules, "dask", None)
    assert main(["batch", *good, "--local-cluster", "2"]) == 1
    assert "pip install hc-suite[batch]" in capsys.readouterr().err
    assert not target.exists()
    assert batch(*good) == 0
    assert batch(*good) == 2
    assert "--resume" in capsys.readouterr().err


def test_a_worker_with_other_software_is_refused(
    make_recordings: MakeRecordings,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(campaign, "software_stamp", lambda: 64 * "0")
    assert batch(make_recordings(1), "-o", tmp_path / "out") == 1
    told = capsys.readouterr().err
    assert "other software" in told
    assert told.count("\n") == 1
    assert not list((tmp_path / "out").glob("results/*/*"))


def test_the_filter_of_another_package_is_part_of_the_software(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: --resume kept the results of a filter that had been changed since."""
    file = tmp_path / "kernel.py"
    monkeypatch.setattr(software, "sources_of", lambda group: [file] * (group == "hc.filters"))
    stamps = []
    for text in ("a = 1", "a = 2", "a = 1"):
        file.write_text(text)
        software.software_stamp.cache_clear()
        stamps.append(software.software_stamp())
    software.software_stamp.cache_clear()
    assert stamps[0] != stamps[1]
    assert stamps[0] == stamps[2]
