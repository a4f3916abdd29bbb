"""Fake robots, nodes and commands in a domain of the test's own; all of them end with it."""

import errno
import fcntl
import json
import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from pathlib import Path

import pytest

from hc_bringup import heartbeat
from hc_msgs_py.node_processes import Processes

HEARTBEAT = re.compile(rf"^{re.escape(heartbeat.MARK)}.*\n", re.MULTILINE)
HERE = Path(__file__).parent


class Bench(Processes):
    """Starts processes in one ROS domain and one folder, each with a log of its own."""

    def __init__(self, domain_id, folder):
        super().__init__(domain_id, folder, COLUMNS="100")
        self.folder = folder

    def start(self, *words):
        log = (self.folder / f"process_{len(self.started)}.log").open("w")
        return super().start(*words, stdout=log, stderr=subprocess.STDOUT)

    def robot(self, **specification):
        """Start a fake robot; see fake_robot.DEFAULTS."""
        path = self.folder / "robot.json"
        path.write_text(json.dumps(specification))
        return self.start(str(HERE / "fake_robot.py"), str(path))

    def hc(self, *words, timeout=300.0):
        """Run hc to its end; what it says of itself on a busy machine is left out."""
        done = self.run("-m", "hc_bringup", *words, timeout_s=timeout)
        done.stderr = HEARTBEAT.sub("", done.stderr)
        return done

    def terminal(self, *words):
        """Run hc at a terminal; a context manager."""
        return Terminal(self, *words)

    def patiently(self, *words, attempts=20):
        """Run hc again while it has not discovered yet what the test has just started."""
        for _ in range(attempts):
            done = self.hc(*words)
            unseen = (
                "there is no node",
                "there is no service",
                "nobody offers",
                "nobody publishes",
                "sends anything",
                "no such topic",
                "starting: ",
            )
            if not any(word in done.stderr for word in unseen):
                return done
            time.sleep(1.0)
        return done


ESCAPES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>]")


class Terminal:
    """`hc` with a terminal of its own. Use as a context manager."""

    def __init__(self, bench, *words):
        self._master, slave = pty.openpty()
        # A terminal of its own session, so that Ctrl-C reaches hc as it does for a user.
        self.process = bench.launch(
            [sys.executable, "-m", "hc_bringup", *words],
            env=bench.environment | {"COLUMNS": "110", "LINES": "40", "TERM": "xterm"},
            stdin=slave,
            stdout=slave,
            stderr=slave,
            start_new_session=True,
            preexec_fn=_take_terminal,
        )
        os.close(slave)
        self.seen = ""
        self._read_to = 0

    def __enter__(self):
        return self

    def __exit__(self, *_exception):
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGINT)
            try:
                self._drain(20.0)
            finally:
                if self.process.poll() is None:
                    os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        os.close(self._master)

    def _take(self, seconds):
        """Read what comes; False once the terminal is closed."""
        if not select.select([self._master], [], [], seconds)[0]:
            return True
        try:
            more = os.read(self._master, 65536)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            more = b""
        self.seen += ESCAPES.sub("", more.decode(errors="replace"))
        return bool(more)

    def _drain(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end and self._take(0.2):
            pass

    def wait_for(self, pattern, patience_s=120.0):
        """Read on until something is shown, and return the match; what came before is done with."""
        end = time.monotonic() + patience_s
        while (found := re.search(pattern, self.seen[self._read_to :])) is None:
            alive = self._take(0.5)
            assert alive or re.search(pattern, self.seen[self._read_to :]), (
                f"ended without {pattern!r}:\n{self.seen}"
            )
            assert time.monotonic() < end, f"no {pattern!r}:\n{self.seen[-6000:]}"
        self._read_to += found.end()
        return found

    def type(self, text):
        os.write(self._master, text.encode())

    def status(self, patience_s=60.0):
        """Read to the end and return the exit status."""
        self._drain(patience_s)
        return self.process.wait(timeout=patience_s)


def _take_terminal():
    fcntl.ioctl(0, termios.TIOCSCTTY, 0)


@pytest.fixture
def bench(ros_domain, tmp_path):
    bench = Bench(ros_domain, tmp_path)
    yield bench
    bench.close()
