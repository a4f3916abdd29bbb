"""Which software this is: version, and the commit that it was checked out or built from."""

from __future__ import annotations

import shlex
import subprocess
import sys
from datetime import date
from importlib import resources

from hc_bringup.paths import checkout_root
from hc_msgs_py.version import VERSION


def version_line() -> str:
    """Return version and commit in a line, for example `hc 0.1.0 (commit 1a2b3c4, changed)`.

    The commit is that of the checkout, or the one that the wheel was built from. "changed" says
    that files which git knows differ from it.
    """
    return _version(".")


def origin_line() -> str:
    """Say where figures of this moment come from: the command, the version and commit, the day.

    "changed" says that sources or settings differ from the commit; a page that was written just
    now does not make the next figures others.
    """
    command = shlex.join(["hc", *sys.argv[1:]])
    return f"`{command}`, {_version('src', 'config')}, {date.today().isoformat()}."


def _version(*judged: str) -> str:
    commit = _checked_out(judged) or _built_from()
    return f"hc {VERSION} ({f'commit {commit}' if commit else 'commit unknown'})"


def _checked_out(judged: tuple[str, ...]) -> str:
    """The commit of the checkout, and whether the files judged differ from it.

    Nothing without a checkout or without git.
    """
    root = checkout_root()
    if root is None or not (root / ".git").exists():
        return ""
    git = ("git", "-C", str(root))
    try:
        commit = subprocess.run(
            [*git, "describe", "--always", "--exclude=*", "--abbrev=7"],
            capture_output=True,
            text=True,
            check=True,
            timeout=20,
        ).stdout.strip()
        same = subprocess.run(
            [*git, "diff", "--quiet", "HEAD", "--", *judged], capture_output=True, timeout=20
        )
    except (OSError, subprocess.SubprocessError):  # no git here, or not ours to look into
        return ""
    return commit if same.returncode == 0 else f"{commit}, changed"


def _built_from() -> str:
    """The commit that wheels_fix.cmake wrote beside this package, or nothing."""
    path = resources.files("hc_bringup") / "commit.txt"
    return path.read_text(encoding="utf-8").strip() if path.is_file() else ""
