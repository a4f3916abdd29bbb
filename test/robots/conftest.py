"""Fake robots, nodes and commands in a domain of the test's own; all of them end with it."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hc_msgs_py.node_processes import Processes

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

    def hc(self, *words, timeout=90.0):
        """Run hc to its end."""
        return subprocess.run(
            [sys.executable, "-m", "hc_bringup", *words],
            cwd=self.folder,
            env=self.environment,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )

    def patiently(self, *words, attempts=5):
        """Run hc again while it has not discovered yet what the test has just started."""
        for _ in range(attempts):
            done = self.hc(*words)
            unseen = ("there is no node", "nobody publishes", "sends anything", "no such topic")
            if not any(word in done.stderr for word in unseen):
                return done
            time.sleep(1.0)
        return done


@pytest.fixture
def bench(ros_domain, tmp_path):
    bench = Bench(ros_domain, tmp_path)
    yield bench
    bench.close()
