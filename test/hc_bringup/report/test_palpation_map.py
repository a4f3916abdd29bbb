"""The map of hc contacts: a lump where it is, honest about what was not felt."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.errors import UserError
from hc_bringup.report import map_file
from hc_bringup.report.contacts import Contact, find_contacts
from hc_bringup.report.palpation_map import MeasuredPlaces, fit_map, measured_places
from hc_bringup.tip_path import TipPath

pytest.importorskip("sklearn")

MakeRun = Callable[..., Any]


def lump(position: Any, centre: tuple[float, float] = (12.0, 8.0)) -> Any:
    distance = np.linalg.norm(position - np.array(centre), axis=-1)
    return 0.3 * (1.0 + 2.0 * np.exp(-((distance / 4.0) ** 2)))


def places_of(position: Any, deviation: float = 0.03, seed: int = 0) -> MeasuredPlaces:
    random = np.random.default_rng(seed)
    noise = deviation * random.standard_normal(len(position))
    return MeasuredPlaces(
        position,
        np.log(lump(position)) + noise,
        np.full(len(position), deviation**2),
        np.full(len(position), 3.0),
        1.0,
    )


@pytest.fixture(scope="module")
def plane() -> Any:
    x, y = np.meshgrid(np.arange(0.0, 24.1, 2.0), np.arange(0.0, 16.1, 2.0))
    position = np.column_stack([x.ravel(), y.ravel()])
    position = position[~((position[:, 0] > 18.0) & (position[:, 1] > 10.0))]  # never felt there
    return fit_map(places_of(position))


def test_map_of_a_plane_finds_the_lump(plane: Any) -> None:
    assert not plane.is_line
    assert plane.lump is not None
    x, y, factor, deviation, passed = plane.lump
    assert passed
    assert 0.0 < deviation < 0.25 * factor
    assert abs(x - 12.0) < 1.0
    assert abs(y - 8.0) < 1.0
    assert factor > 1.8


def test_uncertainty_covers_the_truth_where_it_was_felt(plane: Any) -> None:
    x, y = np.meshgrid(plane.x_mm, plane.y_mm)
    truth = np.log(lump(np.stack([x, y], axis=-1)))
    error = np.abs(np.log(plane.stiffness) - truth)
    inside = (x < 17.0) | (y < 9.0)
    assert np.mean(error[inside] <= 3.0 * plane.log_std[inside]) > 0.9
    # In the corner that was never touched it says that it knows less.
    corner = (x > 21.0) & (y > 13.0)
    assert plane.log_std[corner].min() > 2.0 * np.median(plane.log_std[inside])


def test_uncertain_contacts_count_less() -> None:
    """Five neighbours say the same: believed if they are sure of it, hardly if they are not."""
    position = np.column_stack([np.linspace(0.0, 20.0, 21), np.zeros(21)])
    places = places_of(position)
    places.log_stiffness[8:13] += 0.7
    truth = np.log(lump(position[10]))
    at_10 = np.argmin(np.abs(fit_map(places).x_mm - 10.0))
    assert np.log(fit_map(places).stiffness[0, at_10]) - truth > 0.4
    places.variance[8:13] = 1.0
    assert abs(np.log(fit_map(places).stiffness[0, at_10]) - truth) < 0.2


def test_line_of_contacts_and_scan_along_it(make_run: MakeRun) -> None:
    """Single presses along a line, and one long contact that slides along it, give the same map."""
    seconds = 12.0
    path = np.linspace(0.0, seconds, 600)
    tip = TipPath(path, np.column_stack([2.0 * path, np.zeros_like(path)]))

    def stiffness(time_s: Any) -> Any:
        x = 2.0 * time_s
        return lump(np.column_stack([x, np.zeros_like(x)]), (12.0, 0.0))

    single = make_run(stiffness=stiffness, seconds=seconds, tip=tip, filter_name="ekf")
    contacts = find_contacts(single)
    assert len(contacts) == 12
    found = fit_map(measured_places(single, contacts, 1.0))
    assert found.is_line
    assert found.lump is not None
    assert abs(found.lump[0] - 12.0) < 2.5
    sliding = make_run(
        stiffness=stiffness, seconds=seconds, tip=tip, lifted_mm=-0.5, filter_name="ekf"
    )
    (contact,) = find_contacts(sliding)
    assert contact.travel_mm > 20.0
    places = measured_places(sliding, [contact], 1.0)
    assert len(places.log_stiffness) > 20
    slid = fit_map(places)
    assert slid.lump is not None
    assert abs(slid.lump[0] - 12.0) < 2.5


def test_too_few_places_is_one_line(make_run: MakeRun) -> None:
    data = make_run(seconds=2.0)
    contacts: list[Contact] = find_contacts(data)
    with pytest.raises(UserError, match=r"no position is recorded \(--tip TOPIC"):
        measured_places(data, contacts, 1.0)
    time_s = np.array([0.0, 2.0])
    there = dataclasses.replace(data, tip=TipPath(time_s, np.full((2, 2), 5.0)))
    with pytest.raises(UserError, match="and 1 is known: press at more") as raised:
        measured_places(there, find_contacts(there), 1.0)
    assert "--tip" not in str(raised.value)


@pytest.mark.parametrize("suffix", map_file.SUFFIXES)
def test_files(plane: Any, suffix: str, tmp_path: Path) -> None:
    content = map_file.encode(plane, Path(f"map{suffix}"), "a map")
    begins = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF", ".csv": b"x [mm],y [mm]"}
    assert content.startswith(begins.get(suffix, b"ply\nformat ascii"))
    if suffix == ".csv":
        rows = np.genfromtxt(content.decode().splitlines()[1:], delimiter=",")
        assert rows.shape == (plane.stiffness.size, 6)
        np.testing.assert_allclose(rows[:, 2], plane.stiffness.ravel(), rtol=1e-5)
        assert (rows[:, 3] <= rows[:, 2]).all()
        assert (rows[:, 2] <= rows[:, 4]).all()


def test_a_picture_names_the_axes_that_are_sideways(plane: Any) -> None:
    """Regression: with --tip-axes zx they were called x and y all the same."""
    drawn = map_file.draw(plane, "a map", "zx")
    labels = [(axes.get_xlabel(), axes.get_ylabel()) for axes in drawn.axes]
    assert labels[0] == ("z [mm]", "x [mm]")
    assert labels[1][0] == "z [mm]"
    line = fit_map(places_of(np.column_stack([np.linspace(0.0, 24.0, 49), np.full(49, 8.0)])))
    assert "sideways: y [mm]" in [a.get_xlabel() for a in map_file.draw(line, "", "yz").axes]


def test_the_label_of_a_hard_spot_is_readable_beside_a_narrow_map(plane: Any) -> None:
    """Regression: it was white, and wider than the map, so that its ends were white on white."""
    (label,) = [text for text in map_file.draw(plane, "a map").axes[0].texts if text.get_text()]
    assert label.get_bbox_patch() is not None
    assert label.get_bbox_patch().get_facecolor()[:3] == (0.0, 0.0, 0.0)


def test_tissue_that_is_the_same_everywhere_has_one_colour() -> None:
    """Regression: differences of 1e-7 N/mm, a thousandth of the deviation, took all colours."""
    x, y = np.meshgrid(np.arange(0.0, 14.1, 2.0), np.arange(0.0, 14.1, 2.0))
    position = np.column_stack([x.ravel(), y.ravel()])
    random = np.random.default_rng(1)
    for deviation in (1e-7, 1e-3, 0.2):
        level = deviation * random.standard_normal(len(position))
        variance = np.full(len(position), deviation**2)
        places = MeasuredPlaces(position, level, variance, np.full(len(position), 3.0), 1.0)
        found = fit_map(places)
        low, high = found.colour_range
        assert high - low >= 0.099 * np.median(found.stiffness)
        assert low <= found.stiffness[found.known].min()
        assert high >= found.stiffness[found.known].max()
        ends = map_file.draw(found, "a map").axes[0].images[0].get_clim()
        assert ends == pytest.approx((low, high))
        mesh = map_file.encode(found, Path("map.ply"), "a map").decode().splitlines()
        rows = mesh[mesh.index("end_header") + 1 :][: found.stiffness.size]
        colours = {tuple(row.split()[3:6]) for row in rows}
        if deviation < 0.01:
            assert len(colours) < 0.2 * 256


def test_tissue_that_is_the_same_everywhere_is_known_where_it_was_felt() -> None:
    """Regression: 94 % of it was grey, not known (at 5 % for each place, 42 %)."""
    x, y = np.meshgrid(np.arange(0.0, 14.1, 2.0), np.arange(0.0, 14.1, 2.0))
    position = np.column_stack([x.ravel(), y.ravel()])
    never = (position[:, 0] > 8.5) & (position[:, 1] > 8.5)
    for seed in range(4):
        level = 0.2 * np.random.default_rng(seed).standard_normal(len(position))
        places = MeasuredPlaces(
            position[~never],
            level[~never],
            np.full(np.count_nonzero(~never), 0.2**2),
            np.full(np.count_nonzero(~never), 3.0),
            1.0,
        )
        found = fit_map(places)
        grid_x, grid_y = np.meshgrid(found.x_mm, found.y_mm)
        felt = (grid_x < 8.0) | (grid_y < 8.0)
        assert found.known[felt].mean() > 0.9
        assert np.mean(np.abs(np.log(found.stiffness)) < 3.0 * found.log_std) > 0.95
        assert found.lump is None


def test_the_colours_of_tissue_that_differs_are_those_of_its_ends(plane: Any) -> None:
    shown = plane.stiffness[plane.known]
    assert plane.colour_range == pytest.approx((shown.min(), shown.max()))


def test_mesh_is_whole(plane: Any) -> None:
    lines = map_file.encode(plane, Path("map.ply"), "a map").decode().splitlines()
    end = lines.index("end_header")
    counts = {line.split()[1]: int(line.split()[2]) for line in lines if line.startswith("element")}
    vertices = lines[end + 1 : end + 1 + counts["vertex"]]
    faces = lines[end + 1 + counts["vertex"] :]
    assert len(faces) == counts["face"]
    assert len(vertices) == plane.stiffness.size
    for face in faces:
        number, *corners = map(int, face.split())
        assert number == len(corners) == 4
        assert max(corners) < counts["vertex"]


def test_a_lump_that_was_not_passed_has_no_place_yet() -> None:
    """Regression: half way up the flank, the map told a hard spot beyond where it was felt."""
    way = np.column_stack([np.linspace(0.0, 10.0, 21), np.full(21, 8.0)])
    up = fit_map(places_of(way))
    assert up.lump is not None
    assert not up.lump.passed
    assert up.lump.x_mm <= 10.0
    said = up.lump.sentence(up.is_line)
    assert said.startswith("Harder up to ")
    assert "where the map ends" in said
    past = fit_map(places_of(np.column_stack([np.linspace(0.0, 24.0, 49), np.full(49, 8.0)])))
    assert past.lump is not None
    assert past.lump.passed
    assert past.lump.sentence(past.is_line).startswith("A hard spot at 1")
