"""Master and slave as two nodes on two hosts: two network namespaces and a link with delay.

The link is the channel: nothing of it is simulated. Skipped where namespaces are not allowed.
"""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hc_msgs_py.node_processes import Processes, end, ros_arguments
from hc_sim_rig.scenario import SCENARIO_FOLDER

pytestmark = pytest.mark.process
HERE = Path(__file__).resolve().parent
DELAY_S = 0.06
SECONDS = 5.0


@pytest.mark.slow
def test_master_and_slave_on_two_hosts(join_hosts, ros_domain: int, tmp_path: Path) -> None:
    link = join_hosts(DELAY_S, 0.002)
    quiet = (SCENARIO_FOLDER / "teleoperation.yaml").read_text()
    quiet = quiet.replace("enters: velocity", "enters: none").replace("0.7071068", "0.01")
    scenario = tmp_path / "quiet.yaml"
    scenario.write_text(quiet)
    environment = {
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET",
        "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # or shared memory would be a short cut
    }
    with Processes(ros_domain, **environment) as processes:
        for side, namespace in zip(("master", "slave"), link.namespaces, strict=True):
            parameters = {"scenario": scenario, "side": side}
            words = ros_arguments(parameters, "-r", "__node:=indenter", "-r", f"__ns:=/{side}")
            with (tmp_path / f"{side}.txt").open("w") as log:
                through = ("ip", "netns", "exec", namespace)
                processes.start(
                    "-m", "hc_sim_rig.node", *words, through=through, stdout=log, stderr=log
                )
        through = ("ip", "netns", "exec", link.namespaces[1])
        observer = (str(HERE / "two_hosts_observer.py"), str(SECONDS))
        done = processes.run(*observer, through=through, timeout_s=90.0)
        assert done.returncode == 0, done.stderr
        result = json.loads(done.stdout)
        assert [end(process)[0] for process in processes.started] == [0, 0]
    # No upper limits on time: this machine may be busy. The link's delay cannot be undercut.
    assert result["messages"] > 0.3 * SECONDS * 1000, result
    assert result["latency_s"][0] > DELAY_S - 0.01, result
    assert result["master_mm"] > 20.0, result
    assert result["slave_mm"] > 15.0, result  # it came through the surface
    assert 0.1 < result["force_n"] < 3.0, result
