"""Where configuration files and the checkout are, in a checkout, a pip install or a workspace."""

from __future__ import annotations

import os
import sys
from pathlib import Path

from hc_bringup.errors import WRONG_USE, UserError
from hc_msgs_py.nearest import hint


def checkout_root() -> Path | None:
    """Return the root of the checkout that this code runs from, or None when it is installed."""
    root = Path(os.environ.get("HC_ROOT") or Path(__file__).resolve().parents[3])
    return root if (root / "src" / "hc_msgs").is_dir() else None


def config_folder() -> Path:
    """Return the folder with run configurations and parameter files.

    Raises:
        UserError: if the installation lacks it.
    """
    candidates = [Path(p) / "share/hc_bringup/config" for p in _prefixes()]
    root = checkout_root()
    if root is not None:
        candidates.insert(0, root / "config")
    for folder in candidates:
        if folder.is_dir():
            return folder
    raise UserError("the configuration files are missing: install the suite again")


def _prefixes() -> list[str]:
    return [sys.prefix, *filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep))]


def find_config(name: str) -> Path:
    """Return a configuration file given as a path, or by its name in the config folder.

    Raises:
        UserError: if there is none; the message lists the names that exist.
    """
    folder = config_folder()
    places = (
        Path(name),
        folder / name,
        folder / f"{name}.yaml",
        folder / "robots" / f"{name}.yaml",
    )
    for candidate in places:
        if candidate.is_file():
            return candidate.resolve()
    if Path(name).is_fifo():  # read more than once, and by its name others are found beside it
        raise UserError(f"{name} is a pipe: write it to a YAML file, and give that", WRONG_USE)
    known = sorted(p.stem for p in folder.glob("*.yaml"))
    known += sorted(f"robots/{p.stem}" for p in folder.glob("robots/*.yaml"))
    raise UserError(
        f"no configuration {name!r}; {hint(name, known, 'give a YAML file, or one of')}", WRONG_USE
    )
