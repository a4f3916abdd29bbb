"""One version in all the places that name it."""

from __future__ import annotations

import re
from pathlib import Path

import hc_logger

FOLDER = Path(__file__).parents[2] / "src" / "hc_logger"


def test_the_version_is_that_of_the_package_files() -> None:
    for name, pattern in (
        ("package.xml", r"<version>(.*)</version>"),
        ("setup.py", r'version="(.*)"'),
    ):
        match = re.search(pattern, (FOLDER / name).read_text())
        assert match is not None
        assert match[1] == hc_logger.__version__
