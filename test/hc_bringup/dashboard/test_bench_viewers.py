"""hc bench viewers: the viewers really look, one of them really does not read."""

from __future__ import annotations

import json
from typing import Any

import pytest

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(400)]


def test_figures_of_none_one_and_five_viewers(command_line: Any) -> None:
    done = command_line.run("bench", "viewers", "--duration", "3", "--json", timeout=390)
    assert done.returncode == 0, done.stderr
    figures = json.loads(done.stdout)
    assert list(figures) == ["0 viewers", "1 viewer", "5 viewers, 1 of them stalled"]
    for case in figures.values():
        assert case["estimates"] > 1000
        assert 0.0 < case["latency_us"]["p50"] <= case["latency_us"]["p99"]
        assert {"estimator", "dashboard"} <= set(case["cpu_percent"])
    none, one, five = figures.values()
    assert "bytes_per_second_each" not in none
    # Fifty rows a second, each of some hundred bytes at least.
    assert one["bytes_per_second_each"] > 5_000.0
    assert five["bytes_per_second_each"] > 5_000.0
    # Who looks is seen: without viewers the dashboard does not even read the estimates.
    assert none["cpu_percent"]["dashboard"] < one["cpu_percent"]["dashboard"]
