"""What docs/design.md says that a command prints with --json is in what it prints."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = str(ROOT / "bags" / "example")
LISTED = re.compile(r"^- `hc ([^`]+)`: (.+?)\.$", re.MULTILINE | re.DOTALL)
KEY = re.compile(r"(?P<name>[a-z_0-9]+)(?: \{(?P<below>[^}]*)\})?")


def documented() -> dict[str, dict[str, list[str]]]:
    """Return by command the keys that the page lists, and those below each."""
    page = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    part = page.partition("With `--json`")[2].partition("The two `stiffness_if")[0]
    found: dict[str, dict[str, list[str]]] = {}
    for command, text in LISTED.findall(part):
        keys = re.sub(r"\([^)]*\)|\[[^]]*\]|\band\b", "", text)
        found[command] = {}
        for match in KEY.finditer(keys):
            below = match["below"] or ""
            found[command][match["name"]] = [] if ":" in below else re.findall(r"\w+", below)
    return found


DOCUMENTED = documented()


def steel(folder: Path) -> str:
    """A recording of three presses on something rigid."""
    time_s = np.arange(1200) * 0.01
    force = 20.0 * np.maximum(-np.cos(0.5 * np.pi * time_s), 0.0)
    air = 2.0 * np.minimum(-np.cos(0.5 * np.pi * time_s), 0.0)
    noise = np.random.default_rng(4).standard_normal((2, 1200))
    rows = [time_s, 3.0 + air + 0.004 * force + 0.001 * noise[0], force + 0.02 * noise[1]]
    head = "time_s,displacement_mm,force_N"
    path = folder / "steel.csv"
    np.savetxt(path, np.column_stack(rows), delimiter=",", header=head, comments="")
    return str(path)


HERE = {
    "estimate": lambda _: ["estimate", EXAMPLE],
    "estimate --verify": lambda _: ["estimate", EXAMPLE, "--verify"],
    "doctor": lambda _: ["doctor", EXAMPLE],
    "contacts": lambda folder: ["contacts", EXAMPLE, "-o", str(folder / "contacts.csv")],
    "compare": lambda folder: [
        *("compare", EXAMPLE, "--filter", "ukf", "--filter", "ekf"),
        *("-o", str(folder / "page.html")),
    ],
    "batch": lambda folder: ["batch", EXAMPLE, "-o", str(folder / "batch")],
    "compliance": lambda folder: ["compliance", steel(folder)],
}
IN_PROCESSES = {
    "run": ["run", "--headless", "--duration", "2", "--bag", "bag"],
    "replay": ["replay", EXAMPLE, "--rate", "4", "--duration", "4"],
}


def assert_holds(command: str, text: str) -> None:
    summary = json.loads(text)
    for name, below in DOCUMENTED[command].items():
        assert name in summary, name
        assert set(below) <= set(summary[name] if below else ()), name


def test_the_page_lists_every_command_that_is_tried() -> None:
    assert set(DOCUMENTED) == {*HERE, *IN_PROCESSES}
    assert DOCUMENTED["run"]["latency_us"] == ["p50", "p99", "max"]
    assert len(DOCUMENTED["estimate"]) == 19


@pytest.mark.parametrize("command", HERE)
def test_what_is_documented_is_printed(command: str, tmp_path: Path, capsys) -> None:
    assert main([*HERE[command](tmp_path), "--json"]) == 0
    assert_holds(command, capsys.readouterr().out)


@pytest.mark.process
@pytest.mark.timeout(180)
@pytest.mark.parametrize("command", IN_PROCESSES)
def test_what_is_documented_is_printed_of_nodes(command: str, command_line) -> None:
    done = command_line.run(*IN_PROCESSES[command], "--json", timeout=120.0)
    assert done.returncode == 0, done.stderr
    assert_holds(command, done.stdout)
