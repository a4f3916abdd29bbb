"""What the guide shows as printed is what the command prints now."""

import os
import re
from pathlib import Path

import pytest

from hc_bringup.cli import main

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/guide/recordings.md"
SHARED_DATA = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared" / "data"))
SHOWN = "./hc estimate ../shared/data/palpation_scan.csv"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
TIME_OF_A_STEP = re.compile(r"; [\d.]+ us a step")
"""What a machine takes for a step is no matter of the page."""
CALM = 0.1  # relative: the last digits turn on the processor


def differing(page: str, now: str) -> list[str]:
    """Lines whose words differ, or whose numbers do by more than a tenth."""
    found = []
    for was, becomes in zip(page.splitlines(), now.splitlines(), strict=True):
        words = [" ".join(NUMBER.sub("#", line).split()) for line in (was, becomes)]
        numbers = [[float(text) for text in NUMBER.findall(line)] for line in (was, becomes)]
        if words[0] != words[1] or numbers[1] != pytest.approx(numbers[0], rel=CALM):
            found.append(becomes)
    return found


def test_what_differs_is_found() -> None:
    assert not differing("K = 0.20 ± 2e-03  N", "K = 0.21 ± 2e-03 N")
    assert differing("K = 0.20 ± 2e-03 N", "K = 0.25 ± 2e-03 N")
    assert differing("did not fit in 6 %", "fits in 6 %")


@pytest.mark.skipif(not SHARED_DATA.is_dir(), reason="the recordings in ../shared/data are absent")
def test_the_guide_shows_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    text = PAGE.read_text(encoding="utf-8")
    shown = text[text.index(f"```sh\n{SHOWN}\n```") :].partition("```text\n")[2].partition("```")[0]
    assert main(["estimate", str(SHARED_DATA / "palpation_scan.csv")]) == 0
    printed = TIME_OF_A_STEP.sub("", capsys.readouterr().out)
    assert not differing(shown, printed), f"docs/guide/recordings.md is older; now:\n{printed}"
