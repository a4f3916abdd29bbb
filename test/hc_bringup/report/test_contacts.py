"""hc contacts: the same contacts as the node finds, no phantoms, every number with its unit."""

from __future__ import annotations

import csv
import itertools
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from hc_bringup.cli import main
from hc_bringup.report.contact_file import columns, encode
from hc_bringup.report.contacts import ContactRules, find_contacts
from hc_bringup.report.run_page import _contact_table
from hc_bringup.tip_path import TipPath
from hc_estimator import create_estimator
from hc_estimator.stream.contacts import ContactTracker

EXAMPLE = Path(__file__).resolve().parents[3] / "bags" / "example"
MakeRun = Callable[..., Any]


def test_contacts_are_those_of_the_node(make_run: MakeRun) -> None:
    """The node's tracker, fed sample by sample, is the oracle."""
    data = make_run(seconds=7.3)
    tracker = ContactTracker()
    estimator = create_estimator("ukf")
    expected = []
    for number, (t, d, f) in enumerate(
        zip(data.time_s, data.displacement_mm, data.force_n, strict=True)
    ):
        estimate = estimator.step(t, d, f)
        _made, over = tracker.update(round(t * 1e9), number, d, f, estimate)
        if over is not None:
            expected.append(over)
    last = tracker.finish()
    assert last is not None
    expected.append(last)
    found = find_contacts(data)
    assert len(found) == len(expected) == 8
    for mine, theirs in zip(found, expected, strict=True):
        assert (mine.number, mine.first, mine.last) == (
            theirs.number,
            theirs.first_sequence,
            theirs.last_sequence,
        )
        assert mine.samples == theirs.samples
        np.testing.assert_array_equal(mine.parameters, theirs.parameters)
        np.testing.assert_array_equal(mine.covariance, theirs.covariance)
        assert mine.peak_force_n == theirs.peak_force
        assert mine.peak_depth_mm == theirs.peak_displacement
        assert mine.peak_speed_mm_s == pytest.approx(theirs.peak_speed)
        assert mine.energy_in_mj == pytest.approx(theirs.energy_in)
        assert mine.energy_loss_mj == pytest.approx(theirs.energy_loss)
        assert mine.force_rmse_n == pytest.approx(theirs.force_rmse)


def test_resting_on_the_surface_makes_no_phantoms(make_run: MakeRun) -> None:
    """Real presses, then a tool that rests at zero: noise makes it touch hundreds of times."""
    data = make_run(seconds=4.0)
    resting = data.time_s > 2.0
    random = np.random.default_rng(3)
    data.displacement_mm[resting] = 2e-3 * random.standard_normal(resting.sum())
    data.force_n[resting] = 2e-3 * random.standard_normal(resting.sum())
    data.estimates["displacement"][resting] = data.displacement_mm[resting] * 1e-3
    data.estimates["contact"][resting] = data.displacement_mm[resting] > 0.0
    bare = ContactRules(minimum_duration_s=0.0, release_s=0.0)
    assert len(find_contacts(data, bare)) > 100
    for rules in (ContactRules(minimum_depth_mm=0.1), ContactRules(0.0, 0.02, 0.0, 0.05)):
        assert len(find_contacts(data, rules)) == 2


def test_a_slow_sensor_has_contacts_too(make_run: MakeRun) -> None:
    """At 10 Hz the next sample comes later than a contact needs to be over."""
    data = make_run(seconds=24.0, rate_hz=10.0, period_s=6.0)
    found = find_contacts(data, ContactRules(minimum_depth_mm=0.1))
    assert len(found) == 4
    assert all(contact.duration_s > 3.0 for contact in found)


def test_refused_samples_end_no_contact(make_run: MakeRun) -> None:
    """As in the node: what was refused says nothing; a gap in the recording does."""
    data = make_run(seconds=1.0)
    (whole,) = find_contacts(data, ContactRules(minimum_depth_mm=0.1))
    middle = (whole.first + whole.last) // 2
    data.estimates["rejected"][middle : middle + 40] = 4  # 80 ms
    (same,) = find_contacts(data, ContactRules(minimum_depth_mm=0.1))
    assert (same.first, same.last, same.rejected) == (whole.first, whole.last, 40)
    data.time_s[middle:] += 1.0
    assert len(find_contacts(data, ContactRules(minimum_depth_mm=0.1))) == 2


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.0, 0.5), st.floats(0.0, 0.3), st.floats(0.0, 3.0), st.floats(0.0, 2.0))
def test_rules_hold_for_every_contact(
    make_run: MakeRun, duration: float, release: float, depth: float, force: float
) -> None:
    data = make_run(seconds=3.0, rate_hz=200.0)
    rules = ContactRules(duration, release, depth, force)
    found = find_contacts(data, rules)
    for contact in found:
        assert contact.duration_s >= duration
        assert contact.peak_depth_mm >= depth
        assert contact.peak_force_n >= force
    for one, other in itertools.pairwise(found):
        assert other.start_s - one.end_s >= release
    assert [c.number for c in found] == list(range(1, len(found) + 1))


def test_table_has_header_units_and_every_value(make_run: MakeRun, tmp_path: Path) -> None:
    tip = TipPath(np.array([0.0, 10.0]), np.array([[0.0, 5.0], [20.0, 5.0]]))
    found = find_contacts(make_run(seconds=4.0, tip=tip))
    path = tmp_path / "contacts.csv"
    path.write_bytes(encode(found, ".csv"))
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found)
    for name in rows[0]:
        assert name.endswith("]") or name.startswith("cov_"), name
    for row, contact in zip(rows, found, strict=True):
        assert float(row["stiffness [N/mm^n]"]) == contact.parameters[0]
        assert float(row["cov_stiffness_displacement_exponent"]) == contact.covariance[0, 2]
        assert float(row["peak_depth [mm]"]) == contact.peak_depth_mm
        middle = 0.5 * (contact.start_s + contact.end_s)
        assert float(row["x [mm]"]) == pytest.approx(2.0 * middle)
        assert float(row["y [mm]"]) == 5.0


def test_parquet_equals_csv(make_run: MakeRun, tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    found = find_contacts(make_run(seconds=3.0))
    path = tmp_path / "contacts.parquet"
    path.write_bytes(encode(found, ".parquet"))
    table = parquet.read_table(path).to_pydict()
    expected = columns(found)
    assert list(table) == list(expected)
    for name, values in expected.items():
        np.testing.assert_array_equal(table[name], values, err_msg=name)


def test_without_a_contact_there_is_a_header_only(make_run: MakeRun) -> None:
    data = make_run(seconds=2.0)
    data.estimates["contact"][:] = False
    assert find_contacts(data) == []
    assert encode([], ".csv").count(b"\n") == 1


def test_command(
    make_run: MakeRun,
    write_csv: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    recording = write_csv(make_run(seconds=4.0))
    target = tmp_path / "contacts.csv"
    words = ["contacts", str(recording), "--filter", "ukf"]
    assert main([*words, "-o", str(target), "--minimum-depth", "0.5"]) == 0
    assert "4 contacts" in capsys.readouterr().out
    assert target.read_text().count("\n") == 5
    for wrong, says in (
        (["-o", str(target)], "exists already"),
        (["-o", str(tmp_path / "c.txt")], ".parquet"),
        (["--map", str(tmp_path / "m.jpg")], ".ply"),
        ([], "give a table"),
        (["--map", str(tmp_path / "m.png")], "which tells no place"),
        (["--map", str(tmp_path / "m.png"), "--tip", "tool_pose"], "CSV file"),
    ):
        assert main([*words, *wrong]) in (1, 2)
        told = capsys.readouterr().err
        assert says in told
        assert told.count("\n") == 1
    assert not (tmp_path / "m.png").exists()


def test_the_surface_of_each_contact_stands_beside_what_counts_from_it(make_run: MakeRun) -> None:
    """Regression: of places that differ in height nobody could say from where their K counts."""
    data = make_run(seconds=3.0)
    contacts = find_contacts(data)
    assert "surface [mm]" not in _contact_table(contacts)  # of ukf, which takes it for exact
    half = contacts[0].last + 1
    data.estimates["contact_position"][:half] = 1.3e-3
    data.estimates["contact_position"][half:] = -0.8e-3
    data.estimates["contact_position_std"] = 2e-5
    contacts = find_contacts(data)
    table = columns(contacts)
    assert table["surface [mm]"][:2] == pytest.approx([1.3, -0.8])
    assert table["surface_std [mm]"][0] == pytest.approx(0.02)
    page = _contact_table(contacts)
    assert "surface [mm]" in page
    assert "1.300 ± 0.040" in page
    assert "count from its surface" in page


@pytest.mark.parametrize("at", [2.5, 3.0])  # within a touch, and between two
def test_a_clock_that_is_set_back_loses_no_contact(make_run: MakeRun, at: float) -> None:
    """Regression: of 19 contacts in a bag whose stamps went back by 5 s twice 15 were found."""
    data = make_run(seconds=6.0)
    usual = find_contacts(data)
    data.time_s[data.time_s >= at] -= 1.7
    found = find_contacts(data)
    assert len(found) == len(usual) + (at == 2.5)  # the touch that it falls into is two
    assert all(contact.duration_s > 0.0 for contact in found)
    assert [c.samples for c in found[-2:]] == [c.samples for c in usual[-2:]]
    assert sum(contact.samples for contact in found) == sum(c.samples for c in usual)


def test_what_of_a_bag_could_not_be_read_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Regression: the contacts of the part that was there, without a word; the report as well."""
    shutil.copytree(EXAMPLE, tmp_path / "bag")
    (tmp_path / "bag" / "metadata.yaml").unlink()
    (file,) = (tmp_path / "bag").glob("*.mcap")
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    for words in (["contacts", "-o", "contacts.csv"], ["report", "-o", "page.html"]):
        target = str(tmp_path / words[-1])
        assert main([words[0], str(tmp_path / "bag"), "-o", target]) == 0
        assert f"{tmp_path / 'bag'}: {file.name}: cut off at byte" in capsys.readouterr().err
