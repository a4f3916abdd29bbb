"""What the guide shows as printed is what the command prints now."""

import os
import re
from pathlib import Path

import pytest

from hc_bringup.cli import main
from hc_msgs_py.node_processes import Processes

ROOT = Path(__file__).resolve().parents[2]
PAGE = "docs/guide/recordings.md"
OF_PLACES = "docs/guide/looking.md"
SHARED_DATA = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared" / "data"))
SHOWN = "./hc estimate ../shared/data/palpation_scan.csv"
PLACES = "./hc contacts ../shared/data/palpation_press_triangle.csv --sites -o sites.csv"
PLAYED = """./hc bag convert ../shared/data/palpation_scan.csv scan_bag
./hc replay scan_bag --estimator"""
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")
TIME_OF_A_STEP = re.compile(r"; [\d.]+ us a step")
"""What a machine takes for a step is no matter of the page."""
WRITTEN = re.compile(r"^written: .*\n", re.MULTILINE)
PROCESSOR_USE = re.compile(r"^processor use: .*\n", re.MULTILINE)
needs_recordings = pytest.mark.skipif(
    not SHARED_DATA.is_dir(), reason="the recordings in ../shared/data are absent"
)
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


def shown_below(commands: str, page: str = PAGE) -> str:
    """What a page shows as printed by a block of commands."""
    text = (ROOT / page).read_text(encoding="utf-8")
    return (
        text[text.index(f"```sh\n{commands}\n```") :].partition("```text\n")[2].partition("```")[0]
    )


@needs_recordings
def test_the_guide_shows_what_the_command_prints(capsys: pytest.CaptureFixture[str]) -> None:
    shown = shown_below(SHOWN)
    assert main(["estimate", str(SHARED_DATA / "palpation_scan.csv")]) == 0
    printed = TIME_OF_A_STEP.sub("", capsys.readouterr().out)
    assert not differing(shown, printed), f"{PAGE} is older; now:\n{printed}"


@needs_recordings
def test_the_guide_shows_the_places_that_the_command_finds(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """Regression: the page had a deviation of the surface and a B of some days before."""
    recording = str(SHARED_DATA / "palpation_press_triangle.csv")
    assert main(["contacts", recording, "--sites", "-o", str(tmp_path / "sites.csv")]) == 0
    printed = WRITTEN.sub("", capsys.readouterr().out)
    shown = shown_below(PLACES, OF_PLACES)
    assert not differing(shown, printed), f"{OF_PLACES} is older; now:\n{printed}"


@needs_recordings
@pytest.mark.slow
@pytest.mark.process
def test_the_guide_shows_what_the_replay_prints(processes: Processes, tmp_path: Path) -> None:
    bag = str(tmp_path / "scan_bag")
    assert main(["bag", "convert", str(SHARED_DATA / "palpation_scan.csv"), bag]) == 0
    words = ("-m", "hc_bringup", "replay", bag, "--estimator", "--headless")
    done = processes.run(*words, timeout_s=100.0)
    assert done.returncode == 0, done.stderr
    shown, printed = (PROCESSOR_USE.sub("", text) for text in (shown_below(PLAYED), done.stdout))
    assert not differing(shown, printed), f"{PAGE} is older; now:\n{printed}"
