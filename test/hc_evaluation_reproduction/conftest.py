"""One quick campaign of all experiments for the tests that look at what it leaves behind."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_evaluation.reproduction import ReproductionResult, run_reproduction


@pytest.fixture(scope="session")
def quick_campaign(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[ReproductionResult, list[tuple[str, int, int]]]:
    """The result of `hc reproduce --quick`, and what its progress callback was told."""
    output: Path = tmp_path_factory.mktemp("reproduction")
    told: list[tuple[str, int, int]] = []
    result = run_reproduction(
        quick=True, output=output, workers=2, progress=lambda *what: told.append(what)
    )
    return result, told
