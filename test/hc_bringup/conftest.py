"""Helpers of the process tests: every one in a domain of its own, on this machine only."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

HC = [sys.executable, "-m", "hc_bringup"]


class CommandLine:
    """Runs hc as a process in one ROS domain."""

    def __init__(self, domain_id: int, folder: Path) -> None:
        self.folder = folder
        self.environment = {
            **os.environ,
            "ROS_DOMAIN_ID": str(domain_id),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "COLUMNS": "100",
        }
        self.started: list[subprocess.Popen[str]] = []

    def run(self, *words: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
        """Run a command to its end."""
        return subprocess.run(
            [*HC, *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )

    def start(
        self, *words: str, module: str = "hc_bringup", through: Sequence[str] = ()
    ) -> subprocess.Popen[str]:
        """Start a command (or another module), through another program if given; it goes on."""
        process = subprocess.Popen(
            [*through, sys.executable, "-m", module, *words],
            cwd=self.folder,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        self.started.append(process)
        return process


@pytest.fixture
def command_line(ros_domain: int, tmp_path: Path) -> Iterator[CommandLine]:
    """A command line in a domain of its own; what it started is ended with the test."""
    line = CommandLine(ros_domain, tmp_path)
    yield line
    for process in line.started:
        if process.poll() is None:
            process.kill()
        process.communicate()
