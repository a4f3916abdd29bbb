"""The wheel: the same bytes from the same sources, and extras that are what the messages name."""

import hashlib
import importlib
import os
import re
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

tomllib = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


def build(folder: Path) -> Path:
    """Build it from a copy of what git holds, in a folder of another name each time."""
    sources = folder / "sources"
    listed = subprocess.run(
        ["git", "-C", str(ROOT), "ls-files", "-z"], capture_output=True, check=True
    ).stdout
    for name in filter(None, listed.decode().split("\0")):
        if (ROOT / name).is_file():
            (sources / name).parent.mkdir(parents=True, exist_ok=True)
            (sources / name).write_bytes((ROOT / name).read_bytes())
            (sources / name).chmod(0o644)
    words = ["-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "-w", str(folder)]
    done = subprocess.run(
        [sys.executable, *words, str(sources)],
        env=os.environ | {"SOURCE_DATE_EPOCH": "1763800000"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    (wheel,) = folder.glob("hc_suite-*.whl")
    return wheel


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_two_builds_give_the_same_wheel(tmp_path: Path) -> None:
    first, second = build(tmp_path / "first"), build(tmp_path / "another_name")
    with zipfile.ZipFile(first) as one, zipfile.ZipFile(second) as other:
        assert one.namelist() == other.namelist()
        differing = [name for name in one.namelist() if one.read(name) != other.read(name)]
    assert not differing
    hashes = {hashlib.sha256(path.read_bytes()).hexdigest() for path in (first, second)}
    assert len(hashes) == 1


def test_every_extra_that_somebody_is_told_to_install_exists() -> None:
    texts = [*ROOT.glob("src/**/*.py"), *ROOT.glob("docs/**/*.md"), ROOT / "README.md"]
    texts.append(ROOT / "mkdocs.yml")
    named = {
        extra
        for path in texts
        for extra in re.findall(r"hc-suite\[(\w+)\]", path.read_text(encoding="utf-8"))
    }
    assert named >= {"dashboard", "batch", "docs"}
    assert named <= EXTRAS.keys()
