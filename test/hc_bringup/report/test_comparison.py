"""hc compare: the figures are those of the runs, the winners those with the best figures."""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_bringup.report.comparison import Entry, Scores, Variant, common_samples, compare, scores
from hc_bringup.report.comparison_page import FIGURES, comparison_page, winners
from hc_estimator import create_estimator
from hc_logger.recording import read_recording

MakeRun = Callable[..., Any]


@pytest.fixture(scope="module")
def page() -> Iterator[Any]:
    """A browser, where there is one."""
    sys.path.insert(0, str(Path(__file__).parents[1] / "dashboard"))
    import browser

    reason = browser.why_not()
    if reason:
        pytest.skip(reason)
    opened = browser.Browser()
    yield opened
    opened.close()


def judged(data: Any, microseconds: float) -> Scores:
    """Scores of a run alone."""
    return scores(data, microseconds, common_samples([data])[0])


def test_what_a_variant_refuses_counts_all_the_same(make_run: MakeRun) -> None:
    """Regression: refusing whatever it could not foretell made a filter the best."""
    runs = [make_run(seconds=6.0) for _ in range(3)]
    open_eyes, also, choosy = runs
    for data in runs:
        data.estimates["force_predicted"][1500:2000] += 1.0  # nobody foretold that second
    choosy.estimates["rejected"][1500:2000] = 4
    choosy.estimates["contact"][2000:2250] = False
    masks = common_samples(runs)
    assert np.array_equal(masks[0], masks[2])
    assert masks[0][1500:2250].any()
    errors = [scores(d, 1.0, m) for d, m in zip(runs, masks, strict=True)]
    assert errors[2].force_rms_n == errors[0].force_rms_n == errors[1].force_rms_n > 0.3
    assert errors[2].refused == pytest.approx(500 / len(choosy.time_s), abs=1e-9)
    assert common_samples([]) == []
    fewer = make_run(seconds=3.0)  # a recorder that was stopped early
    both = common_samples([open_eyes, fewer])
    assert len(both[1]) == len(fewer.time_s)
    assert both[0].sum() == both[1].sum() > 0
    assert also.used.all()


def test_scores_are_those_of_the_run(make_run: MakeRun) -> None:
    data = make_run(seconds=6.0)
    got = judged(data, 2.0)
    touching = data.contact & data.used
    settled = touching & (data.time_s - data.time_s[touching][0] >= 1.0)
    error = (data.force_n - data.force_predicted_n)[settled]
    assert got.force_rms_n == pytest.approx(np.sqrt(np.mean(error**2)))
    assert got.nis == pytest.approx(np.mean(data.nis[settled]))
    expected = np.median(np.abs(data.parameters / data.truth - 1.0)[settled], axis=0)
    np.testing.assert_allclose(got.parameter_errors, expected)
    assert got.microseconds == 2.0
    assert got.refused == 0
    assert 0.0 < got.nees < 100.0
    assert got.inside > 0.5


def test_scores_without_truth_or_contact_are_left_open(make_run: MakeRun) -> None:
    blind = judged(make_run(seconds=3.0, truth=None), 1.0)
    assert math.isnan(blind.nees)
    assert np.isnan(blind.parameter_errors).all()
    air = make_run(seconds=3.0)
    air.estimates["contact"][:] = False
    nothing = judged(air, 1.0)
    assert math.isnan(nothing.force_rms_n)
    assert math.isnan(nothing.ahead_rms_n)


def test_every_recording_goes_through_every_variant(
    make_run: MakeRun, write_csv: Callable[..., Path]
) -> None:
    paths = [write_csv(make_run(seconds=3.0, seed=s), f"{s}.csv") for s in (1, 2)]
    recordings = [read_recording(path) for path in paths]
    variants = [Variant("ukf", "ukf", {}), Variant("slow", "ukf", {"stiffness_log_walk": 1e-6})]
    steps: list[tuple[int, int]] = []
    table = compare(recordings, variants, lambda done, number, _what: steps.append((done, number)))
    assert steps == [(0, 4), (1, 4), (2, 4), (3, 4), (4, 4)]
    for recording, entries in zip(recordings, table, strict=True):
        assert [e.variant.label for e in entries] == ["ukf", "slow"]
        for entry, variant in zip(entries, variants, strict=True):
            estimator = create_estimator("ukf", **variant.settings)
            series = estimator.run(recording.time_s, recording.displacement_mm, recording.force_n)
            np.testing.assert_array_equal(entry.data.parameters, series.parameters)


def test_winners_have_the_best_figures(make_run: MakeRun) -> None:
    good, bad = make_run(seconds=6.0), make_run(seconds=6.0, seed=2)
    bad.estimates["stiffness"] *= 1.5
    entries = [
        Entry(Variant("bad", "ukf", {}), bad, judged(bad, 1.0)),
        Entry(Variant("good", "ukf", {}), good, judged(good, 2.0)),
    ]
    words = winners(entries)
    assert "good foretells the force best, half a second ahead." in words
    assert "good is closest to the true K." in words
    assert "bad is the quickest." in words
    assert any(line.startswith("None is honest") for line in winners(entries[:1] * 2))
    air = make_run(seconds=3.0)
    air.estimates["contact"][:] = False
    untouched = [Entry(Variant(name, "ukf", {}), air, judged(air, 1.0)) for name in "ab"]
    assert winners(untouched) == [
        "None was ever in contact, so there is nothing to compare: hc doctor says why."
    ]
    # Never reporting a misfit is no merit.
    judge = next(figure for figure in FIGURES if "does not fit" in figure[1])[4]
    assert math.isnan(judge(0.0))


def test_page_in_a_browser(
    page: Any, make_run: MakeRun, write_csv: Callable[..., Path], tmp_path: Path
) -> None:
    evil = "<img src=x onerror=document.title='caught'>.csv"
    recording = read_recording(write_csv(make_run(seconds=4.0), evil))
    table = compare([recording], [Variant("ukf", "ukf", {}), Variant("<b>ekf", "ekf", {})])
    target = tmp_path / "page.html"
    target.write_text(comparison_page(table, ["hc", "compare", evil]), encoding="utf-8")
    page.complaints()
    page.open(target.as_uri())
    page.wait_for("HC.comparison && HC.comparison.charts.length === 6")
    assert page.complaints() == []
    assert page.run("return document.querySelectorAll('main img, main b').length") == 0
    drawn = page.run("return HC.comparison.charts[0].chart.plot.data[1].filter((v) => v !== null)")
    stiffness = table[0][0].data.parameters[:, 0].astype(np.float32)
    assert set(np.float32(drawn)) <= set(stiffness)
    # One bad curve hides no good one: errors are drawn in decades, and none is cut off above.
    assert page.run("return HC.comparison.charts.map((c) => c.chart.plot.scales.y.distr)") == [
        *[1] * 4,
        *[3] * 2,
    ]
    beyond = "c.chart.plot.data[1].some((v) => v > c.chart.plot.scales.y.max)"
    assert not page.run(f"return HC.comparison.charts.slice(4).some((c) => {beyond})")
    page.run("document.querySelector('[data-variant=\"1\"]').click()")
    assert page.run("return HC.comparison.charts.every((c) => !c.chart.plot.series[2].show)")
    page.run("HC.onZoom(1.0, 2.0)")
    assert page.run("return HC.comparison.charts[5].chart.plot.scales.x.max") == pytest.approx(2.0)
    page.resize(360, 900)
    page.wait_for(
        "document.documentElement.scrollWidth <= innerWidth"
    )  # charts follow a frame later
    # A name that is squeezed to a letter a line is none.
    names = "document.querySelectorAll('.scores tbody td:first-child')"
    assert page.run(f"return Math.min(...[...{names}].map((e) => e.clientWidth))") >= 80


def test_command(
    make_run: MakeRun,
    write_csv: Callable[..., Path],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    recording = str(write_csv(make_run(seconds=3.0)))
    target = tmp_path / "page.html"
    both = ["--filter", "ukf", "--with", "ukf initial_stiffness=2e-1 state_space=paper"]
    assert main(["compare", recording, *both, "-o", str(target), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["recordings"][0]["scores"]
    assert set(told) == {"ukf", "ukf initial_stiffness=2e-1 state_space=paper"}
    assert "state_space=paper" in target.read_text(encoding="utf-8")
    other = str(tmp_path / "other.html")
    for wrong, says in (
        ([*both, "-o", str(target)], "exists already"),
        ([*both, "-o", "page.pdf"], ".html"),
        (["--filter", "ukf", "-o", other], "at least two"),
        (["--filter", "nosuch", "-o", other], "nosuch"),
        (["--filter", "ukf", "--filter", "nope", "-o", other], "nope"),
        (["--filter", "ukf", "--filter", "ukf", "-o", other], "given twice"),
        (["--filter", "ukf", "--with", "ukf nonsense", "-o", other], "name=value"),
        (["--filter", "ukf", "--with", "", "-o", other], "give a filter"),
        (["--filter", "ukf", "--with", "ukf 'x", "-o", other], "No closing quotation"),
        (["--filter", "ukf", "--with", "ukf filter=ekf", "-o", other], "give a filter"),
        (["--filter", "ukf", "--with", "force_zero=1", "-o", other], "give a filter"),
        (["--filter", "ukf", "--with", "ukf a=1 a=2", "-o", other], "given twice"),
        (["--filter", "ukf", "--with", "ukf stiffness_log_walk=-1", "-o", other], "from 0 to"),
        (["--recorded", "--recorded", "--filter", "ukf", "-o", other], "leaves nothing to compare"),
    ):
        status = main(["compare", recording, *wrong])
        assert status in (1, 2)
        error = capsys.readouterr().err
        assert says in error
        assert error.count("\n") == 1
    assert main(["compare", recording, *both, "--recorded", "-o", other]) == 0
    error = capsys.readouterr().err
    assert "holds no recorded estimates (a bag of hc run does): --recorded shows nothing" in error


def test_a_filter_is_not_praised_for_what_it_does_not_estimate(make_run: MakeRun) -> None:
    """Regression: `rls`, which holds p, was the closest to it, and the most honest."""
    data = make_run(seconds=6.0)
    data.estimates["velocity_exponent_std"][:] = 0.0
    variance = data.estimates["covariance"].reshape(-1, 16)
    variance[20:, 15] = 0.0
    got = judged(data, 1.0)
    assert math.isnan(got.nees)
    assert np.isnan(got.parameter_errors).tolist() == [False, False, False, True]


def test_columns_stand_below_their_own_headline(make_run: MakeRun) -> None:
    """Regression: without a truth the NIS was an error of the force."""
    data = make_run(seconds=3.0, truth=None)
    entry = Entry(Variant("ukf", "ukf", {}), data, judged(data, 1.0))
    head = (
        comparison_page([[entry, entry]], ["hc"]).partition("<thead>")[2].partition("</thead>")[0]
    )
    assert "error of" not in head
    assert '<th colspan="2">force error</th><th colspan="3">honesty</th>' in head
