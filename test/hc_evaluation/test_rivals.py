"""The plain filters that hc bench speed compares with are one filter: the same numbers."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_evaluation.rivals import plain_ukf
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
    for name in ("filterpy_us", "numba_us", "ukf_run_us", "ekf_run_us", "ukf_step_us"):
        assert figures[name] > 0.0
    assert figures["run_ratio"] < 0.1
    assert (figures["cpp_us"] is None) == (figures["ukf_to_cpp"] is None)
    assert figures["cpp"] == "compiled" or figures["cpp_us"] is None
    assert set(figures["filters_us"]) == {
        f"{f}/{s}" for f in ("ukf", "ekf") for s in ("kinematic", "paper")
    }
