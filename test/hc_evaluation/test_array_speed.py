"""The figures of hc bench arrays follow from one another; its channels are out of step."""

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_evaluation import array_speed


def test_figures_of_an_array(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(array_speed, "FILTERS", ("ekf",))
    figures = array_speed.run_array_speed(3, 50)
    assert (figures["channels"], figures["samples"]) == (3, 50)
    found = figures["filters"]["ekf"]
    assert found["channel_us"] == pytest.approx(1e3 * found["step_ms"] / 3)
    assert found["channels_at_1_khz"] == pytest.approx(1e3 / found["channel_us"], abs=1.0)


def test_channels_are_out_of_step() -> None:
    times, depths, forces = array_speed.channel_samples(4, 20)
    assert times.shape == (20,)
    assert depths.shape == forces.shape == (4, 20)
    np.testing.assert_array_equal(depths[1, :-1], depths[0, 1:])
    np.testing.assert_array_equal(forces[3, :-3], forces[0, 3:])


def test_too_many_channels_are_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bench", "arrays", "--channels", "5000"]) == 2
    assert "--channels 5000" in capsys.readouterr().err
