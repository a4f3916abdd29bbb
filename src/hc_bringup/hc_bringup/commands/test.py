"""hc test: ruff, mypy and pytest on the checkout, as CI runs them."""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time

from hc_bringup.errors import FAILURE, WRONG_USE, UserError

HELP = "run all checks and tests of this checkout"
_SOURCES = ("src", "test")
_CHECKS = (
    ("ruff check", ("ruff", "check", *_SOURCES)),
    ("ruff format", ("ruff", "format", "--check", "--quiet", *_SOURCES)),
)
_MYPY = "mypy"
_LOWEST_PRIORITY = "19"
"""Of mypy, which runs beside the tests: it takes what they leave while they wait for processes."""
_ALONE = {"OPENBLAS_NUM_THREADS": "1"}
"""Threads of the linear algebra in each test process. Its matrices are small, and threads that wait
for each other took two fifths of the fits' time (test_channels.py: 28 s against 17 s)."""
_PARALLEL = ("--numprocesses=3", "--dist=loadfile", "--no-loadscope-reorder")
"""Three processes for the two cores of CI: tests of processes wait for two fifths of their
time. They come first (test/conftest.py); a file's tests stay together."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "pytest_arguments",
        nargs=argparse.REMAINDER,
        metavar="-- PYTEST ARGUMENTS",
        help="given to pytest alone, for example: -- test/hc_logger -k csv",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.paths import checkout_root

    root = checkout_root()
    if root is None or not (root / "test").is_dir():
        raise UserError("the tests are in the checkout only: clone it and use ./hc test", WRONG_USE)
    extra = [a for a in arguments.pytest_arguments if a != "--"]
    # Tests start processes of their own environment; what this one inherited must not leak in.
    environment = {
        k: v for k, v in os.environ.items() if not k.startswith(("ROS_DOMAIN_ID", "PYTEST_"))
    }
    failed = []
    for name, command in _CHECKS:
        start = time.monotonic()
        status = subprocess.run(
            [sys.executable, "-m", *command], cwd=root, env=environment, check=False
        ).returncode
        if not _tell(name, status, start):
            failed.append(name)
    start = time.monotonic()
    with subprocess.Popen(
        ["nice", "-n", _LOWEST_PRIORITY, sys.executable, "-m", _MYPY],
        cwd=root,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as beside:
        status = subprocess.run(
            [sys.executable, "-m", "pytest", *_PARALLEL, *extra],
            cwd=root,
            env=_ALONE | environment,
            check=False,
        ).returncode
        if status != 0:
            failed.append("pytest")
        said, _ = beside.communicate()
    print(said, end="")
    if not _tell(_MYPY, beside.returncode, start):
        failed.append(_MYPY)
    if failed:
        raise UserError(f"failed: {', '.join(failed)}", FAILURE)
    return 0


def _tell(name: str, status: int, start_s: float) -> bool:
    """Print how a check ended; returns whether it passed."""
    passed = status == 0
    print(f"{name}: {'passed' if passed else 'FAILED'} in {time.monotonic() - start_s:.0f} s")
    sys.stdout.flush()
    return passed
