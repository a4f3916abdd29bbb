"""Folders of small recordings, some of them broken."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture
def make_recordings(tmp_path: Path) -> Callable[..., Path]:
    """Function (count, seconds) -> a folder of CSV recordings of presses, one a second."""

    def make(count: int = 3, seconds: float = 2.0, name: str = "recordings") -> Path:
        folder = tmp_path / name
        folder.mkdir()
        for i in range(count):
            random = np.random.default_rng(i)
            time_s = np.arange(0.0, seconds, 1.0 / 400.0)
            phase = 2.0 * np.pi * time_s
            depth = 1.25 * (1.0 - np.cos(phase)) - 0.5
            speed = 1.25 * 2.0 * np.pi * np.sin(phase)
            force = np.maximum(0.0, np.maximum(depth, 0.0) ** 1.5 * (0.3 + 0.1 * i + 0.02 * speed))
            noise = random.standard_normal((2, len(time_s)))
            rows = np.column_stack([time_s, depth + 1e-3 * noise[0], force + 2e-3 * noise[1]])
            header = "time_s,displacement_mm,force_N"
            path = folder / f"r{i:04d}.csv"
            np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.9g")
        return folder

    return make


@pytest.fixture
def break_some() -> Callable[[Path], int]:
    """Puts broken recordings into a folder; returns how many."""

    def put(folder: Path) -> int:
        (folder / "empty.csv").write_text("")
        (folder / "words.csv").write_text("this,is,no,recording\n")
        (folder / "cut.csv").write_text("time_s,displacement_mm,force_N\n0.0,1.0,0.1\n0.001,1.0\n")
        (folder / "noise.mcap").write_bytes(bytes(range(256)) * 4)
        (folder / "air.csv").write_text(
            "time_s,displacement_mm,force_N\n" + "".join(f"{i / 500},-1.0,0.0\n" for i in range(99))
        )
        return 5

    return put


@pytest.fixture
def call_it_another_study() -> Callable[[Path], None]:
    """Lets what is in a folder be of a study that any other goes on with, as before 2026-11-28."""

    def rewrite(target: Path) -> None:
        manifest = json.loads((target / "manifest.json").read_text())
        del manifest["reading"]
        (target / "manifest.json").write_text(json.dumps(manifest | {"variants": []}))

    return rewrite
