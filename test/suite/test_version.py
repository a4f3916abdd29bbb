"""One version in all the places that name it, and hc --version, which says the commit too."""

import importlib
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest
import yaml

import hc_estimator
import hc_logger
from hc_bringup import about, cli
from hc_msgs_py.version import VERSION

tomllib = importlib.import_module("tomllib" if sys.version_info >= (3, 11) else "tomli")
ROOT = Path(__file__).resolve().parents[2]


def test_whoever_repeats_the_version_repeats_this_one() -> None:
    named = {
        path.relative_to(ROOT).as_posix(): ElementTree.parse(path).findtext("version")
        for path in ROOT.glob("src/*/package.xml")
    }
    assert len(named) == 7
    named["hc_estimator"] = hc_estimator.__version__
    named["hc_logger"] = hc_logger.__version__
    named["CITATION.cff"] = yaml.safe_load((ROOT / "CITATION.cff").read_text())["version"]
    sections = re.findall(r"^## (\S+)", (ROOT / "CHANGELOG.md").read_text(), flags=re.MULTILINE)
    named["CHANGELOG.md"] = next(s for s in sections if s != "Unreleased")
    assert not {place: found for place, found in named.items() if found != VERSION}


def test_the_wheel_takes_its_version_from_the_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    rule = project["tool"]["scikit-build"]["metadata"]["version"]
    match = re.search(rule["regex"], (ROOT / rule["input"]).read_text())
    assert match is not None
    assert match["value"] == VERSION


def test_hc_version_names_the_commit(capsys: pytest.CaptureFixture[str]) -> None:
    git = ["git", "-C", str(ROOT), "rev-parse", "--short=7", "HEAD"]
    commit = subprocess.run(git, capture_output=True, text=True, check=False).stdout.strip()
    if not commit:
        pytest.skip("this is no git checkout, or git is not here")
    with pytest.raises(SystemExit) as end:
        cli.main(["--version"])
    assert end.value.code == 0
    line = capsys.readouterr().out
    assert re.fullmatch(rf"hc {re.escape(VERSION)} \(commit {commit}\w*(, changed)?\)\n", line)


def test_a_wheel_knows_the_commit_it_was_built_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(about, "checkout_root", lambda: None)
    monkeypatch.setattr(about.resources, "files", lambda _: tmp_path)
    assert about.version_line() == f"hc {VERSION} (commit unknown)"
    (tmp_path / "commit.txt").write_text("1a2b3c4\n")
    assert about.version_line() == f"hc {VERSION} (commit 1a2b3c4)"
