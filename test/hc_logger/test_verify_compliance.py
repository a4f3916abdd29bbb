"""A run with a robot that gives way is recomputed to the last bit, also where it was set late."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from hc_estimator import create_estimator
from hc_estimator.stream import taken_off
from hc_estimator.stream.frame_compliance import SETTING
from hc_estimator.stream.taken_off import FORCE_ZERO, POSITION_ZERO
from hc_logger.csv_file import write_csv
from hc_logger.recording import read_recording
from hc_logger.verify import verify

pytestmark = pytest.mark.process

MM_PER_N, LATER = 0.02, 0.05


def samples(path: Path) -> None:
    """Three seconds at 1 kHz; one force for four displacements, and a force alone now and then."""
    random = np.random.default_rng(8)
    t = np.arange(3000) * 1e-3
    d = 2.0 + 1.5 * np.sin(2 * np.pi * 1.5 * t)
    force = 0.5 * np.maximum(d, 0.0) ** 1.4 + random.normal(0, 0.02, len(t))
    places = d + MM_PER_N * force
    force[np.arange(3000) % 4 != 2] = np.nan
    places[np.arange(3000) % 20 == 2] = np.nan
    force[1000] = np.inf
    force[1800:1850] = np.nan
    write_csv(path, [np.column_stack([t, places, force])])


@pytest.mark.timeout(300)  # where the filters have to be compiled first
def test_a_live_run_is_recomputed_to_the_last_bit(
    play_and_record: Callable[..., Any], graph: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Set from the start, changed while it runs, beside a zero, a setting and a reset."""
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter
    from std_srvs.srv import Trigger

    samples(tmp_path / "samples.csv")
    bag, nodes = play_and_record(tmp_path / "samples.csv", **{SETTING.name: MM_PER_N})
    for name, value in (
        ("force_noise_std", 0.05),
        (FORCE_ZERO, 0.1),
        (SETTING.name, LATER),
        ("", None),
        (POSITION_ZERO, 0.2),
    ):
        graph.spin_until(lambda: False, timeout=0.45)
        if not name:
            graph.call(Trigger, "/estimator/reset")
            continue
        parameter = Parameter(name, value=value).to_parameter_msg()
        request = SetParameters.Request(parameters=[parameter])
        answer = graph.call(SetParameters, "/estimator/set_parameters", request).results[0]
        assert answer.successful, answer.reason
    graph.spin_until(lambda: False, timeout=1.2)
    for node in nodes:
        assert node.end() == 0, node.error

    recording = read_recording(bag)
    compliances = [c.parameters[SETTING.name] for c in recording.configurations]
    assert sorted(set(compliances)) == [MM_PER_N, LATER]
    report = verify(recording)
    assert report.differences == []
    assert report.equal
    assert report.compared == len(recording.estimates) > 2000
    assert report.not_comparable == 0

    # The first stretch, by a plain subtraction.
    first = recording.estimates["configuration_revision"] == 1
    count = int(np.count_nonzero(first))
    assert count > 100
    force = recording.force_n[:count]
    last = np.maximum.accumulate(np.where(np.isfinite(force), np.arange(count), -1))
    depth = recording.displacement_mm[:count] - MM_PER_N * np.where(
        last < 0, np.nan, force[np.maximum(last, 0)]
    )
    estimator = create_estimator("ukf", missing_readings=True)
    series = estimator.run(recording.time_s[:count], depth, force)
    np.testing.assert_array_equal(recording.estimates["stiffness"][first], series.parameters[:, 0])

    # And it is the compliance that makes them.
    monkeypatch.setattr(taken_off, "SETTING", SimpleNamespace(name="input.of_nobody"))
    assert verify(recording).different > 0.5 * report.compared
