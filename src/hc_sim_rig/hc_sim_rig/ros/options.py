"""Parameters that the indenter node is started with; all but the scenario stay as they are."""

from __future__ import annotations

from typing import NamedTuple

from rclpy.node import Node

from hc_msgs_py.parameters import declare
from hc_msgs_py.wire_arrays import MOST_SAMPLES
from hc_sim_rig.scenario import Scenario, load_scenario


class Options(NamedTuple):
    """What the node was started with."""

    scenario: Scenario
    seed: int
    start_paused: bool
    exit_at_end: bool
    side: str
    remote_topic: str
    time: str
    rate: float
    lockstep_timeout_s: float
    samples_per_message: int


def declare_options(node: Node) -> Options:
    """Declare the parameters and return their values.

    Raises:
        ScenarioError: if the scenario cannot be.
        ValueError: if parameters contradict each other.
        rclpy.exceptions.ParameterException: if a value is of the wrong type or out of range.
    """
    name = declare(
        node,
        "scenario",
        "multisine",
        "name of a scenario, or path of its YAML file; changes while it runs, at the same rate",
    )
    scenario = load_scenario(name)
    options = Options(
        scenario=scenario,
        seed=declare(
            node, "seed", scenario.seed, "seed of all random draws", minimum=0, read_only=True
        ),
        start_paused=declare(
            node,
            "start_paused",
            False,
            "take the first sample only when ~/run is called with true",
            read_only=True,
        ),
        exit_at_end=declare(
            node,
            "exit_at_end",
            False,
            "end the process when the scenario's duration is over",
            read_only=True,
        ),
        side=declare(
            node,
            "side",
            "both",
            "both: master, channel and slave are simulated here; master or slave: only that one, "
            "the other is a node on another host and the network is the channel",
            choices=("both", "master", "slave"),
            read_only=True,
        ),
        remote_topic=declare(
            node,
            "remote_topic",
            "",
            "where the other side publishes: the slave's wrench for a master, the master's joint "
            "states for a slave; empty: /slave/indenter/wrench, /master/indenter/joint_states",
            read_only=True,
        ),
        time=declare(
            node,
            "time",
            "system",
            "system: stamps from the system's clock, in real time; simulated: stamps and /clock "
            "from the rig, at `rate` times real time; lockstep: the same, but each sample waits "
            "for the estimate of the one before",
            choices=("system", "simulated", "lockstep"),
            read_only=True,
        ),
        rate=declare(
            node,
            "rate",
            1.0,
            "pace of simulated time against real time; in lockstep the largest pace",
            minimum=0.001,
            maximum=1000.0,
            read_only=True,
        ),
        lockstep_timeout_s=declare(
            node,
            "lockstep_timeout",
            2.0,
            "longest wait for an estimate in lockstep",
            minimum=0.001,
            maximum=3600.0,
            unit="s",
            read_only=True,
        ),
        samples_per_message=declare(
            node,
            "samples_per_message",
            1,
            "1: every sample is a message on indenter/sample; more: so many are taken at once and "
            "published in one message on indenter/samples, when the last of them is due",
            minimum=1,
            maximum=MOST_SAMPLES,
            read_only=True,
        ),
    )
    if options.samples_per_message > 1 and (options.time != "system" or options.side != "both"):
        raise ValueError(
            f"parameter samples_per_message is {options.samples_per_message}, must be 1 with "
            f"side {options.side}, time {options.time}"
        )
    if options.time == "system" and options.rate != 1.0:
        raise ValueError(
            f"parameter rate is {options.rate:g}, must be 1 while time is system "
            "(time: simulated runs at another pace)"
        )
    if options.time == "system" and node.get_parameter("use_sim_time").value:
        raise ValueError(
            "parameter use_sim_time is true while time is system: the rig makes time itself "
            "(time: simulated publishes /clock)"
        )
    return options
