"""Campaigns: resumed, spread over processes, refused in one line."""

from __future__ import annotations

import json
import signal
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from hc_evaluation.reproduction import ReproductionError, campaign
from hc_evaluation.reproduction.campaign import run_campaign, run_seeds
from hc_msgs_py.node_processes import Processes

pytestmark = pytest.mark.slow  # whole campaigns: two minutes

NAME = "a_table_2"


@pytest.fixture
def computed(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Seeds that a campaign in this process has computed; no pictures."""
    seeds: list[int] = []

    def watched(name: str, wanted: Sequence[int]) -> dict[int, dict[str, dict[str, float]]]:
        seeds.extend(wanted)
        return run_seeds(name, wanted)

    monkeypatch.setattr(campaign, "run_seeds", watched)
    monkeypatch.setattr(campaign, "draw", lambda name, folder: [])
    return seeds


def test_finished_seeds_are_kept(tmp_path: Path, computed: list[int]) -> None:
    run_campaign([NAME], seeds=2, output=tmp_path, workers=1)
    assert computed == [1, 2]
    longer = run_campaign([NAME], seeds=4, output=tmp_path, workers=1)
    assert computed == [1, 2, 3, 4]
    anew = run_campaign([NAME], seeds=4, output=tmp_path / "other", workers=1)
    assert longer.experiments == anew.experiments
    shorter = run_campaign([NAME], seeds=3, output=tmp_path, workers=1)
    assert len(computed) == 8
    assert shorter.experiments[NAME].seeds == [1, 2, 3]


def test_a_line_cut_off_by_a_crash_is_computed_anew(tmp_path: Path, computed: list[int]) -> None:
    whole = run_campaign([NAME], seeds=3, output=tmp_path, workers=1)
    path = tmp_path / f"runs/{NAME}.jsonl"
    path.write_text(path.read_text(encoding="utf-8")[:-40], encoding="utf-8")
    del computed[:]
    again = run_campaign([NAME], seeds=3, output=tmp_path, workers=1)
    assert computed == [3]
    assert again.experiments == whole.experiments


def test_other_settings_start_anew(tmp_path: Path, computed: list[int]) -> None:
    run_campaign([NAME], seeds=1, output=tmp_path, workers=1)
    path = tmp_path / f"runs/{NAME}.jsonl"
    lines = path.read_text(encoding="utf-8").splitlines()
    lines[0] = json.dumps({"fingerprint": "of something else"})
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    run_campaign([NAME], seeds=1, output=tmp_path, workers=1)
    assert computed == [1, 1]


def test_one_worker_finds_what_two_find(
    tmp_path: Path, quick_campaign: tuple[campaign.ReproductionResult, object]
) -> None:
    two = quick_campaign[0].experiments[NAME]
    one = run_campaign([NAME], seeds=3, output=tmp_path, workers=1).experiments[NAME]
    assert one == two


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"names": ["a_table_9"]}, "no experiment 'a_table_9'; known: a_table_1, "),
        ({"seeds": 0}, "seeds is 0, must be at least 1"),
        ({"workers": 0}, "workers is 0, must be at least 1"),
    ],
)
def test_what_cannot_be_is_refused(change: dict[str, object], message: str, tmp_path: Path) -> None:
    arguments = {"names": [NAME], "seeds": 1, "workers": 1} | change
    names = arguments.pop("names")
    with pytest.raises(ReproductionError, match=message):
        run_campaign(names, output=tmp_path, **arguments)  # type: ignore[arg-type]


def test_a_folder_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ReproductionError, match="cannot write to"):
        run_campaign([NAME], seeds=1, output=tmp_path / "file", workers=1)


SCRIPT = """
import sys, time
from pathlib import Path
import cloudpickle
from hc_evaluation.reproduction import campaign

def run(name, seeds):  # no filter: nothing to compile in three processes
    time.sleep(0.02)
    return {seed: {"a": {"failed": 0.0, "square": float(seed * seed)}} for seed in seeds}

if __name__ == "__main__":
    campaign.run_seeds = run
    cloudpickle.register_pickle_by_value(campaign)  # else the workers import it as it is
    campaign.run_campaign(["a_table_2"], seeds=20000, output=Path(sys.argv[1]), workers=2)
"""


def _children(process: int) -> list[int]:
    found = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                status = (entry / "stat").read_text(encoding="utf-8")
            except (FileNotFoundError, ProcessLookupError):
                continue
            if int(status.rpartition(")")[2].split()[1]) == process:
                found.append(int(entry.name))
    return found


@pytest.mark.process
def test_a_killed_command_leaves_no_process_and_is_resumed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT, encoding="utf-8")
    output = tmp_path / "output"
    path = output / f"runs/{NAME}.jsonl"
    with Processes(None) as processes:
        command = processes.start(str(script), str(output), stdout=subprocess.DEVNULL)
        deadline = time.monotonic() + 80.0
        while not (path.is_file() and path.read_text(encoding="utf-8").count("\n") > 10):
            assert command.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.05)
        children = _children(command.pid)
        assert len(children) >= 2
        processes.close(signal.SIGKILL)
    deadline = time.monotonic() + 20.0
    while any(Path(f"/proc/{child}").exists() for child in children):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    mark = json.loads(path.read_text(encoding="utf-8").splitlines()[0])["fingerprint"]
    monkeypatch.setattr(campaign, "fingerprint", lambda name: mark)
    monkeypatch.setattr(campaign, "draw", lambda name, folder: [])
    computed: list[int] = []

    def run(name: str, seeds: Sequence[int]) -> dict[int, dict[str, dict[str, float]]]:
        computed.extend(seeds)
        return {seed: {"a": {"failed": 0.0, "square": float(seed * seed)}} for seed in seeds}

    monkeypatch.setattr(campaign, "run_seeds", run)
    resumed = run_campaign([NAME], seeds=10, output=output, workers=1)
    assert len(computed) <= 2 * campaign.CHUNK  # what the two workers had in hand
    assert resumed.experiments[NAME].columns["a"]["square"] == [float(k * k) for k in range(1, 11)]
