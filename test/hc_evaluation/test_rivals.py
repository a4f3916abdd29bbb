"""The plain filters that hc bench speed compares with are one filter: the same numbers."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_evaluation.rivals import packages, plain_particles, plain_ukf
from hc_evaluation.speed import contact_samples

SAMPLES = 150


def samples() -> Any:
    return np.ascontiguousarray(contact_samples(SAMPLES)[1:].T)


def filterpy_states() -> Any:
    pytest.importorskip("filterpy")
    ukf = plain_ukf.filterpy_filter()
    states = []
    for reading in samples():
        ukf.predict()
        ukf.update(reading)
        states.append(ukf.x.copy())
    return np.array(states)


@pytest.mark.slow
def test_numba_and_cpp_give_the_numbers_of_filterpy(tmp_path: Path) -> None:
    expected = filterpy_states()
    mine = plain_ukf.numba_runner()(samples())
    np.testing.assert_allclose(mine, expected, rtol=1e-7, atol=1e-7)
    try:
        cpp = plain_ukf.cpp_runner(tmp_path)
    except plain_ukf.NotAvailableError as error:
        pytest.skip(str(error))
    np.testing.assert_allclose(cpp(samples()), expected, rtol=1e-7, atol=1e-7)


def test_what_is_missing_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CXX", "no-such-compiler")
    with pytest.raises(plain_ukf.NotAvailableError, match="no C\\+\\+ compiler"):
        plain_ukf.cpp_runner(tmp_path)
    monkeypatch.setenv("CXX", "true")
    monkeypatch.setattr(plain_ukf, "EIGEN_FOLDERS", (str(tmp_path),))
    with pytest.raises(plain_ukf.NotAvailableError, match="no Eigen"):
        plain_ukf.cpp_runner(tmp_path)
    (tmp_path / "Eigen").mkdir()
    (tmp_path / "Eigen" / "Dense").write_text("")
    monkeypatch.setenv("CXX", "false")
    with pytest.raises(plain_ukf.NotAvailableError, match="does not compile"):
        plain_ukf.cpp_runner(tmp_path)


def test_stone_soup_gives_the_numbers_of_filterpy() -> None:
    pytest.importorskip("stonesoup")
    states = packages.stone_soup_runner()(samples())
    np.testing.assert_allclose(states, filterpy_states(), rtol=1e-7, atol=1e-7)


def test_pykalman_is_the_same_filter_with_points_of_its_own() -> None:
    pytest.importorskip("pykalman")
    states, expected = packages.pykalman_runner()(samples()), filterpy_states()
    np.testing.assert_allclose(states[:, 0], expected[:, 0], atol=1e-4)
    # Force that the last state foretells: K and n trade places more freely than their product.
    forces = [packages.measure(series[-1])[1] for series in (states, expected)]
    assert forces[0] == pytest.approx(forces[1], rel=0.02)


def test_the_vector_form_is_the_plain_one() -> None:
    """What Stone Soup and pykalman are given, against filterpy's functions, point by point."""
    pytest.importorskip("filterpy")
    ukf = plain_ukf.filterpy_filter()
    points = np.random.default_rng(1).uniform(0.1, 2.0, (plain_ukf.STATES, 9))
    points[1, ::2] *= -1.0  # out of the tissue as well
    dt = 1.0 / plain_ukf.RATE_HZ
    for run, expected in (
        (packages.move, lambda x: ukf.fx(x, dt)),
        (packages.measure, ukf.hx),
    ):
        np.testing.assert_allclose(run(points), np.array([expected(x) for x in points.T]).T)


def test_many_numpy_particles_are_a_kalman_filter_where_all_is_linear(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A force that says nothing leaves displacement and velocity, and those are linear."""
    first, spread, process, _ = plain_ukf.start()
    process = process + np.diag([1e-5, 1e-1, 1.0, 0.0, 0.0, 0.0, 0.0])
    noise = np.diag([0.01**2, 1e6**2])
    for module in (plain_ukf, plain_particles):
        monkeypatch.setattr(module, "start", lambda: (first, spread, process, noise))
    expected = plain_ukf.numba_runner()(samples()[:60])
    states = plain_particles.numpy_particles(10_000)(samples()[:60])
    np.testing.assert_allclose(states[:, 0], expected[:, 0], atol=1e-3)  # the sensor: 1e-2 mm
    np.testing.assert_allclose(states[:, 1], expected[:, 1], atol=0.6)  # 10 mm/s at first
    few = plain_particles.numpy_particles(50)
    np.testing.assert_array_equal(few(samples()), few(samples()))


@pytest.mark.parametrize("module", ["stonesoup", "pykalman"])
def test_a_package_that_is_missing_is_named(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.split(".")[0] == module]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, module, None)
    runner = {"stonesoup": packages.stone_soup_runner, "pykalman": packages.pykalman_runner}[module]
    with pytest.raises(plain_ukf.NotAvailableError, match=r"hc-suite\[rivals\]"):
        runner()


@pytest.mark.slow
@pytest.mark.timeout(500)
def test_bench_speed_has_its_figures(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("filterpy")
    from hc_evaluation import speed

    monkeypatch.setattr(speed, "ROUNDS", 2)
    monkeypatch.setattr(speed, "available_filters", lambda: ("ukf", "ekf"))
    assert main(["bench", "speed", "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    steps = [f"{name}_step_us" for name in speed.KALMAN_FILTERS]
    particles = [f"{n}_{c}_ns" for n in ("sir_pf", "numpy_particles") for c in speed.PARTICLES]
    for name in ("filterpy_us", "numba_us", "ukf_run_us", "ekf_run_us", *steps, *particles):
        assert figures[name] > 0.0
    assert figures["run_ratio"] < 0.1
    assert (figures["cpp_us"] is None) == (figures["ukf_to_cpp"] is None)
    assert set(figures["rivals"]) == {"cpp", "stone_soup", "pykalman"}
    for name, said in figures["rivals"].items():
        assert (figures[f"{name}_us"] is not None) == (said == "measured")
    assert set(figures["filters_us"]) == {
        f"{f}/{s}" for f in ("ukf", "ekf") for s in ("kinematic", "paper")
    }
