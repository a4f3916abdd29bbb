"""Master and slave as two nodes on two hosts: two network namespaces and a link with delay.

The link is the channel: nothing of it is simulated. Skipped where namespaces are not allowed.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from hc_sim_rig.scenario import SCENARIO_FOLDER

pytestmark = pytest.mark.process
HERE = Path(__file__).resolve().parent
DELAY_S = 0.06
SECONDS = 5.0


@pytest.mark.slow
def test_master_and_slave_on_two_hosts(join_hosts, tmp_path: Path) -> None:
    link = join_hosts(DELAY_S, 0.002)
    quiet = (SCENARIO_FOLDER / "teleoperation.yaml").read_text()
    quiet = quiet.replace("enters: velocity", "enters: none").replace("0.7071068", "0.01")
    scenario = tmp_path / "quiet.yaml"
    scenario.write_text(quiet)
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": "77",
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # or shared memory would be a short cut
    }
    processes = []
    logs = []
    try:
        for side, namespace in zip(("master", "slave"), link.namespaces, strict=True):
            command = ["ip", "netns", "exec", namespace, sys.executable, "-m", "hc_sim_rig.node"]
            command += ["--ros-args", "-r", "__node:=indenter", "-r", f"__ns:=/{side}"]
            command += ["-p", f"scenario:={scenario}", "-p", f"side:={side}"]
            log = (tmp_path / f"{side}.txt").open("w+")
            logs.append(log)
            processes.append(subprocess.Popen(command, env=environment, stdout=log, stderr=log))
        observer = ["ip", "netns", "exec", link.namespaces[1], sys.executable]
        observer += [str(HERE / "two_hosts_observer.py"), str(SECONDS)]
        done = subprocess.run(
            observer, env=environment, capture_output=True, text=True, timeout=90, check=True
        )
        result = json.loads(done.stdout)
        for process in processes:
            process.send_signal(signal.SIGINT)
        assert [process.wait(timeout=20) for process in processes] == [0, 0]
    finally:
        for process, log in zip(processes, logs, strict=True):
            if process.poll() is None:
                process.kill()
                process.wait()
            log.close()
    # No upper limits on time: this machine may be busy. The link's delay cannot be undercut.
    assert result["messages"] > 0.3 * SECONDS * 1000, result
    assert result["latency_s"][0] > DELAY_S - 0.01, result
    assert result["master_mm"] > 20.0, result
    assert result["slave_mm"] > 15.0, result  # it came through the surface
    assert 0.1 < result["force_n"] < 3.0, result
