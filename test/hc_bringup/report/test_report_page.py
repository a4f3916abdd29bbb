"""The report: right in words, right in numbers, and nothing in it that was not put there."""

from __future__ import annotations

import dataclasses
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_bringup.dashboard.columns import INDEX
from hc_bringup.picture import draw
from hc_bringup.report.rows import page_rows
from hc_bringup.report.run_page import run_page
from hc_bringup.tip_path import TipPath

MakeRun = Callable[..., Any]
EVIL = "<img src=x onerror=document.title='caught'>.csv"


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


def without(data: Any, *gaps: tuple[float, float]) -> Any:
    """A recording whose rows within some times are missing, of all channels."""
    kept = np.ones(len(data.time_s), bool)
    for begin, end in gaps:
        kept &= (data.time_s <= begin) | (data.time_s >= end)
    return dataclasses.replace(
        data,
        time_s=data.time_s[kept],
        displacement_mm=data.displacement_mm[kept],
        force_n=data.force_n[kept],
        estimates=data.estimates[kept],
        truth=data.truth[kept],
    )


def test_gaps_are_no_delay(make_run: MakeRun) -> None:
    """Regression: lines across the gaps passed for a force 10.5 ± 1.8 ms late."""
    data = without(make_run(seconds=8.0), (1.4, 1.55), (2.4, 2.55), (5.7, 5.85), (6.4, 6.55))
    text = run_page(data, ["hc", "report"])
    sentences = re.findall(r"<li[^>]*>(.*?)</li>", text)
    assert "The contact law describes what the sensors say." in sentences
    assert not any("the displacement" in sentence for sentence in sentences), sentences


def test_picture_breaks_where_nothing_was_read(make_run: MakeRun) -> None:
    figure = draw(without(make_run(seconds=6.0), (2.2, 3.4)))
    across = 0
    for axes in figure.axes:
        for line in axes.lines:
            time, values = (np.asarray(a, float) for a in line.get_data())
            if len(time) < 3:
                continue  # a mark, no curve
            known = np.isfinite(values[:-1]) & np.isfinite(values[1:])
            assert np.all(np.diff(time)[known] < 0.2), axes.get_ylabel()
            across += 1
    assert across >= 8


def with_gap(data: Any, at: int, seconds: float) -> Any:
    later = data.time_s.copy()
    later[at:] += seconds
    return dataclasses.replace(data, time_s=later)


def test_a_gap_of_an_hour_is_cut_out_of_the_picture_and_told(make_run: MakeRun) -> None:
    """Regression: two touches an hour apart were two hairlines in empty panels."""
    whole = make_run(seconds=6.0)
    half = len(whole.time_s) // 2
    figure = draw(with_gap(whole, half, 3600.0))
    figure.canvas.draw()
    for axes in figure.axes:
        low, high = axes.get_xlim()
        assert high - low < 7.0, axes.get_ylabel()
    below = [a for a in figure.axes if a.get_xlabel()]
    assert {a.get_xlabel() for a in below} == {"time [s]; grey: gaps that are cut out"}
    names = [label.get_text() for label in below[0].get_xticklabels()]
    assert float(names[0]) == 0.0
    assert any(3603.0 <= float(name) <= 3606.0 for name in names)
    assert "3600 s" in {text.get_text() for text in figure.axes[0].texts}
    plain = draw(whole)
    assert {a.get_xlabel() for a in plain.axes if a.get_xlabel()} == {"time [s]"}
    longest = max(a.get_xlim()[1] for a in draw(with_gap(whole, half, 2.0)).axes)
    assert longest > 7.9  # a gap that leaves something to see is drawn as long as it is


def test_a_page_with_a_gap_of_an_hour_opens_what_lies_between(make_run: MakeRun) -> None:
    whole = make_run(seconds=6.0)
    half = len(whole.time_s) // 2
    data = with_gap(whole, half, 3600.0)
    text = run_page(data, ["hc", "report"])
    found = re.search(r'"pieces": ?(\[\[.*?\]\])', text)
    assert found is not None
    pieces = json.loads(found[1])
    expected = [data.time_s[[0, half - 1]], data.time_s[[half, -1]]]
    np.testing.assert_allclose(pieces, expected)
    assert len(page_rows(data)) == pytest.approx(len(page_rows(whole)), abs=2)
    assert re.search(r'"pieces": ?\[\]', run_page(whole, ["hc", "report"]))


@pytest.mark.parametrize("with_truth", [True, False])
def test_the_legend_names_a_truth_only_where_there_is_one(
    make_run: MakeRun, with_truth: bool
) -> None:
    data = make_run(seconds=3.0)
    figure = draw(data if with_truth else dataclasses.replace(data, truth=None))
    (legend,) = figure.legends
    names = {text.get_text() for text in legend.get_texts()}
    assert ("true; NIS: ideal" in names, "ideal NIS" in names) == (with_truth, not with_truth)


def test_picture_shows_no_force_error_of_refused_readings(make_run: MakeRun) -> None:
    """Regression: a saturated sensor looked like a filter that errs."""
    data = make_run(seconds=3.0)
    data.estimates["rejected"][700:720] = 1
    data.force_n[700:720] = 50.0
    (axes,) = [a for a in draw(data).axes if a.get_ylabel().startswith("force error")]
    assert np.nanmax(axes.lines[0].get_ydata()) < 5000.0  # mN


@pytest.mark.parametrize("seconds", [0.01, 0.4, 3.0, 30.0])
def test_rows_hold_the_estimates(make_run: MakeRun, seconds: float) -> None:
    data = make_run(seconds=seconds)
    rows = page_rows(data)
    assert 1 <= len(rows) <= 4001
    assert rows[:, INDEX["samples"]].sum() == len(data.time_s)
    for row in rows[:: max(1, len(rows) // 50)]:
        at = int(row[INDEX["sequence"]])
        assert row[INDEX["K"]] == data.parameters[at, 0]
        assert row[INDEX["force"]] == data.force_n[at]
        assert row[INDEX["time"]] == pytest.approx(data.time_s[at])
        assert row[INDEX["K_true"]] == data.truth[at, 0]


def test_rows_of_a_recording_whose_time_goes_back(make_run: MakeRun) -> None:
    data = make_run(seconds=2.0)
    data.time_s[500:] -= 0.9
    rows = page_rows(data)
    assert (np.diff(rows[:, 0]) > 0.0).all()
    assert rows[-1, 0] == pytest.approx(data.time_s[-1])


def test_names_are_escaped_everywhere(make_run: MakeRun) -> None:
    data = make_run(
        seconds=2.0,
        name=EVIL,
        findings=(EVIL, "</script><script>alert(1)</script>"),
        settings={EVIL: EVIL},
        versions={EVIL: "<b>"},
    )
    text = run_page(data, ["hc", "report", EVIL, "-o", "x'y.html"])
    assert "<img" not in text
    assert "<b>" not in text.split('class="cards"')[0]
    assert "alert(1)</script>" not in text
    assert text.count("&lt;img src=x") >= 5


def test_page_fetches_nothing_and_allows_only_its_own_scripts(make_run: MakeRun) -> None:
    text = run_page(make_run(seconds=2.0), ["hc", "report"])
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', text).group(1)
    assert policy.startswith("default-src &#x27;none&#x27;")
    assert "unsafe" not in policy
    assert " src=" not in text
    assert "<link" not in text
    assert not re.search(r"\son\w+=", text)
    addresses = set(re.findall(r"https?://[^\s\"')]+", text))
    assert all("github.com/leeoniya" in one or "w3.org" in one for one in addresses), addresses
    assert "Leon Sorokin" in text  # uPlot's licence goes with it


def test_page_in_a_browser(page: Any, make_run: MakeRun, tmp_path: Path) -> None:
    tip = TipPath(np.array([0.0, 8.0]), np.array([[0.0, 0.0], [40.0, 0.0]]))
    data = make_run(seconds=8.0, tip=tip, name=EVIL)
    path = tmp_path / "report.html"
    path.write_text(run_page(data, ["hc", "report", EVIL]), encoding="utf-8")
    page.complaints()
    page.open(path.as_uri())
    page.wait_for("HC.report && HC.report.store.count > 100")
    assert page.complaints() == []
    assert page.driver.title == f"{EVIL}, ukf on kinematic"
    # What is shown is what was estimated, to the precision of float32.
    shown = page.run(
        "return ['K', 'force', 'predicted'].map((n) => Array.from({length: HC.report.store.count},"
        " (_, row) => HC.report.store.at(row, n)))"
    )
    rows = page_rows(data)
    for name, values in zip(("K", "force", "predicted"), shown, strict=True):
        np.testing.assert_allclose(values, rows[:, INDEX[name]], rtol=1e-6)
    assert page.run("return HC.report.timeline.chart.plot.data[0].length") > 100
    # Looking closer: all charts follow.
    page.run("HC.onZoom(2.0, 3.0)")
    assert page.run("return HC.report.parameters[3].chart.plot.scales.x.min") == pytest.approx(2.0)
    assert "2.00 to 3.00 s" in page.text("#zoomed")
    page.run("document.getElementById('whole').click()")
    assert page.run("return HC.report.parameters[3].chart.plot.scales.x.max") > 7.9
    for width in (360, 1300):
        page.resize(width, 900)  # the charts follow when the browser comes to it
        page.wait_for(f"innerWidth === {width} && document.documentElement.scrollWidth <= {width}")
    # Nothing is drawn where it cannot be: no parameter below zero.
    lows = page.run("return HC.report.parameters.map((p) => p.chart.plot.scales.y.min)")
    assert min(lows) >= 0.0


def test_labels_of_large_errors_are_not_cut_off(
    page: Any, make_run: MakeRun, tmp_path: Path
) -> None:
    """Regression: of 150000 mN ".50000" was to be read."""
    data = make_run(seconds=4.0)
    data.estimates["force_predicted"][500:900] += 140.0
    path = tmp_path / "report.html"
    path.write_text(run_page(data, ["hc", "report"]), encoding="utf-8")
    page.open(path.as_uri())
    page.wait_for("HC.report && HC.report.store.count > 100")
    rooms = page.wait_for(
        """(() => {
          const c = document.createElement("canvas").getContext("2d");
          c.font = "11px system-ui, sans-serif";
          const axes = [...HC.charts].map((one) => one.plot.axes[1]).filter((a) => a._values);
          const widest = (a) => Math.max(...a._values.map((v) => c.measureText(v).width));
          const room = (a) => a._size - 7 - widest(a);
          const wide = axes.some((a) => a._values.some((v) => v.length > 6));
          return wide && axes.map(room);
        })()"""
    )
    assert min(rooms) >= 0


def test_words_and_map_say_the_same_of_a_hard_spot(
    page: Any, make_run: MakeRun, tmp_path: Path
) -> None:
    """Each found it by a computation and at a depth of its own: 2.9 in words, 3.0 on the map."""
    way = np.linspace(0.0, 12.0, 600)
    data = make_run(
        stiffness=lambda t: 0.3 * (1.0 + 2.0 * np.exp(-0.5 * ((t - 6.0) / 0.8) ** 2)),
        seconds=12.0,
        tip=TipPath(way, np.column_stack([2.0 * way, np.zeros_like(way)])),
        lifted_mm=-0.5,
        filter_name="ekf",
    )
    path = tmp_path / "report.html"
    path.write_text(run_page(data, ["hc", "report"]), encoding="utf-8")
    page.open(path.as_uri())
    page.wait_for("HC.report && HC.report.map && HC.report.map.lump")
    words = page.text(".verdict")
    said = re.search(r"A hard spot at ([\d.]+ mm): (.*? times as stiff)", words)
    assert said is not None, words
    assert said.groups() == (
        page.run("return HC.lumpPlace(HC.report.map)"),
        page.run("return HC.lumpFactor(HC.report.map.lump)"),
    )
    # The map stands at the depth of the words, and names the spot at any other one too.
    assert page.text("#map output") == f"{page.run('return HC.report.map.depth'):.1f} mm"
    page.run(
        "const slider = document.querySelector('#map input'); slider.value = 1.7;"
        "slider.dispatchEvent(new Event('input'))"
    )
    assert page.run("return HC.report.map.lump.factor") > 1.3
    assert page.complaints() == []


def test_a_gap_breaks_the_curves(page: Any, make_run: MakeRun, tmp_path: Path) -> None:
    """Regression: the charts drew a straight line over what nobody had measured."""
    data = without(make_run(seconds=6.0), (2.2, 3.4))
    data.force_n[np.arange(len(data.force_n)) % 4 != 0] = np.nan  # a slow sensor is no gap
    path = tmp_path / "gap.html"
    path.write_text(run_page(data, ["hc", "report"]), encoding="utf-8")
    page.resize(1300, 1000)
    page.open(path.as_uri())
    page.wait_for("HC.report && HC.report.store.count > 100")
    broken = page.run(
        "return HC.report.panels.filter((p) => p.chart.plot.data.length && p.range)"
        ".map((p) => p.chart.plot).map((u) => u.series.slice(1).map((s, i) =>"
        " HC.timeGaps(u, i + 1, 0, u.data[0].length - 1).map((g) =>"
        " g.map((x) => u.posToVal(x, 'x', true)))))"
    )
    assert len(broken) == 6  # K, B, n, p, force, error
    for chart in broken[:4]:
        for curve in chart[:3]:  # the edges of the band and the value
            assert np.ravel(curve) == pytest.approx([2.2, 3.4], abs=0.1)
    # Of the curve itself nothing is painted there: only grid and background.
    inks = page.run(
        "const u = HC.report.panels[5].chart.plot; const at = (t) => {"
        " const x = Math.round(u.valToPos(t, 'x', true));"
        " const d = u.ctx.getImageData(x, u.bbox.top, 1, u.bbox.height).data;"
        " return new Set(new Uint32Array(d.buffer)).size; };"
        " return [at(1.93), at(2.61), at(2.73), at(3.13), at(3.81)]"
    )
    assert max(inks[1:4]) < min(inks[0], inks[4]), inks


def test_command_writes_each_format(
    make_run: MakeRun, write_csv: Callable[..., Path], tmp_path: Path
) -> None:
    recording = write_csv(make_run(seconds=3.0), EVIL.replace("/", ""))
    for suffix, begin in ((".html", b"<!doctype html>"), (".png", b"\x89PNG"), (".svg", b"<?xml")):
        target = tmp_path / f"out{suffix}"
        assert main(["report", str(recording), "--filter", "ukf", "-o", str(target)]) == 0
        assert target.read_bytes().startswith(begin)
    text = (tmp_path / "out.html").read_text(encoding="utf-8")
    assert "--filter ukf" in text
    data = json.loads(re.search(r'id="data">(.*?)</script>', text).group(1))
    assert data["rows"] > 100


def test_a_batch_is_read_on_a_telephone(page: Any, make_run: MakeRun, tmp_path: Path) -> None:
    """Regression: names stood one letter a line, and there were recordings number 2.5."""
    folder = tmp_path / "many"
    folder.mkdir()
    for i in range(12):
        data = make_run(seconds=2.0, seed=i)
        rows = np.column_stack([data.time_s, data.displacement_mm, data.force_n])
        head = "time_s,displacement_mm,force_N"
        np.savetxt(folder / f"r{i:02}.csv", rows, delimiter=",", header=head, comments="")
    for name in ("empty.csv", "a_recording_with_quite_a_long_name.csv"):
        (folder / name).write_text("")
    target = tmp_path / "out"
    words = ["batch", str(folder), "-o", str(target), "--filter", "ukf", "-j", "1"]
    assert main(words) == 0
    page.complaints()  # of the pages before
    page.resize(390, 844)
    page.open((target / "overview.html").as_uri())
    page.wait_for("document.querySelectorAll('.uplot').length >= 6")
    lines = page.run(
        """const height = (cell) => {
          const range = document.createRange();
          range.selectNodeContents(cell);
          return range.getClientRects().length;
        };
        const all = (cells) => [...document.querySelectorAll(cells)].map(height);
        return [all("th"), all("table.numbers td:first-child:not([colspan])")];"""
    )
    assert max(lines[0]) == 1
    assert max(lines[1]) <= 3  # a name as long as a line leaves nothing else to be seen beside it
    edges = page.run(
        """const edge = (cell) => cell.getBoundingClientRect().right;
        return [...document.querySelectorAll(".note div")].map(edge);"""
    )
    assert len(edges) == 2
    assert max(edges) <= 390  # why there is no result is read without moving the table
    page.resize(1300, 1000)
    labels = page.run(
        """const seen = [];
        const { fillText } = CanvasRenderingContext2D.prototype;
        CanvasRenderingContext2D.prototype.fillText = function (text, ...rest) {
          seen.push(text);
          return fillText.call(this, text, ...rest);
        };
        const host = document.createElement("div");
        host.style.width = "400px";
        document.body.append(host);
        const number = Array.from({ length: 12 }, (_, i) => i + 1);
        HC.batchChart(host, "K", [{ label: "a", number, K: number.map(() => 0.5) }]);
        return new Promise((done) => setTimeout(() => done(seen), 300));"""
    )
    numbers = [text for text in labels if re.fullmatch(r"\d+(\.\d+)?", text)]
    assert {"0", "5", "10"} <= set(numbers)
    assert not {"2.5", "7.5", "12.5"} & set(numbers)
    assert page.complaints() == []
