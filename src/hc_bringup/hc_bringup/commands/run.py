"""hc run: rig, estimator and recorder as processes, live status, clean end, summary."""

from __future__ import annotations

import argparse
import dataclasses
import json
import os
import sys
from datetime import datetime
from pathlib import Path
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.commands import dashboard
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import assignment, natural, positive, seconds
from hc_bringup.param_target import targets
from hc_bringup.parameter_file import read_yaml
from hc_bringup.wrapping import wrapped
from hc_msgs_py.parameter_sections import sections_for
from hc_msgs_py.realtime import (
    CPUS_VARIABLE,
    DEFAULT_PRIORITY,
    PRIORITY_VARIABLE,
    RealtimeError,
    check_permission,
    processors,
    wanted_priority,
)
from hc_msgs_py.topics import NODE_RECORDER

HEARTBEAT = True
HELP = "run rig, estimator and recorder, with live status and a summary at the end"
DEFAULT_CONFIG = "run"
LONGEST_PICTURED_S = 600.0
"""Of a longer run no picture is drawn at the end: reading the bag would take too long."""

SET_BY_THE_RUN = {
    "output": "the folder of a run's bag is given by --bag DIR",
    "custom_data": "a run says there itself how it was made",
    "when_exists": "a run records into a new folder: give it with --bag DIR",
    "remove_empty": "a run keeps no empty bag",
}
"""Parameters of the recorder that a value would be given for in vain."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "config",
        nargs="?",
        default=DEFAULT_CONFIG,
        metavar="CONFIG",
        help="YAML that lists the nodes, or a name from config/ (default: run)",
    )
    parser.add_argument(
        "--duration", type=seconds, metavar="S", help="end after S seconds (0: run until Ctrl-C)"
    )
    parser.add_argument(
        "--bag", metavar="DIR", help="folder of the bag (default: bags/run_DATE_TIME here)"
    )
    parser.add_argument("--scenario", metavar="NAME", help="scenario of the rig")
    parser.add_argument("--seed", type=natural, metavar="N", help="seed of the rig's random draws")
    parser.add_argument(
        "--rate", type=positive, metavar="R", help="simulated seconds per second (default: 1)"
    )
    parser.add_argument("--filter", metavar="F", help="filter of the estimator")
    parser.add_argument("--state-space", metavar="S", help="state space of the estimator")
    parser.add_argument(
        "--param",
        type=assignment,
        action="append",
        default=[],
        metavar="[NODE.]NAME=VALUE",
        help="a parameter of a node, of the estimator without NODE; may be given several times",
    )
    parser.add_argument(
        "--realtime",
        nargs="?",
        type=int,
        const=DEFAULT_PRIORITY,
        metavar="PRIORITY",
        help="real-time scheduling (SCHED_FIFO) and locked memory for all nodes; priority from 1 "
        f"to 99 ({DEFAULT_PRIORITY}); the system must permit it",
    )
    parser.add_argument(
        "--cpus", metavar="LIST", help="processors that the nodes stay on, like 0,2-3"
    )
    parser.add_argument("--headless", action="store_true", help="no live display")
    parser.add_argument(
        "--dashboard",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="live page in a browser; its address is printed (default: in a terminal)",
    )
    dashboard.add_options(parser)
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # ROS and rich are imported here so that `hc --help` need not wait for them.
    from hc_bringup.array_messages import with_array_messages
    from hc_bringup.conclusion import conclude, naming_bag
    from hc_bringup.live import Display
    from hc_bringup.paths import find_config
    from hc_bringup.plan import load_plan
    from hc_bringup.runner import Runner

    if arguments.dashboard is False and (arguments.control or arguments.allow_origin):
        what = "--control and --allow-origin are of the page"
        raise UserError(f"{what}: leave --no-dashboard away", WRONG_USE)
    ask_for_realtime(arguments.realtime, arguments.cpus)
    plan = load_plan(find_config(arguments.config))
    if arguments.duration is not None:
        plan = dataclasses.replace(plan, duration_s=arguments.duration)
    for node, parameters in given_parameters(plan, arguments).items():
        plan = with_parameters(plan, node, parameters)
    check_state_folders(plan)
    plan = with_array_messages(plan)
    scenario = rig_scenario(plan)
    if scenario is not None and (line := scenario.never_happens()):
        print(wrapped(line, stream=sys.stderr), file=sys.stderr)
    bag = None
    if plan.node("recorder") is not None:
        bag = new_bag_folder(arguments.bag)
        plan = with_parameters(
            plan,
            "recorder",
            # The name is new; one that is started again after it died finds its own first bag.
            {
                "output": str(bag),
                "custom_data": custom_data(plan, scenario),
                "when_exists": "number",
                "remove_empty": True,
            },
        )
    elif arguments.bag is not None:
        raise UserError("--bag given, but the configuration starts no recorder", WRONG_USE)
    if wants_page(arguments):
        if dashboard.is_installed():
            plan = with_dashboard(plan, arguments)
        else:
            print(dashboard.HOW_TO_INSTALL, file=sys.stderr)
    with (
        naming_bag(bag, arguments.bag),
        Display(enabled=not arguments.headless, scenario=scenario_name(plan)) as display,
    ):
        state = Runner(plan, display.show, with_truth=display.shows_truth).run()
    heartbeat.doing("summing up")
    names = [node.name for node in plan.nodes]
    bag = conclude(state, names, bag, as_json=arguments.json, with_latency=True)
    if bag is not None and not arguments.json and state.elapsed_s <= LONGEST_PICTURED_S:
        from hc_bringup.run_ending import show_ending  # draws: nothing of it at the start

        namespaces = [one.namespace for one in plan.of_kind("estimator")]
        show_ending(bag, namespaces, controlled=arguments.control)
    return 0


def ask_for_realtime(priority: int | None, cpus: str | None) -> None:
    """Ask for real-time scheduling, and for processors, by the environment of the nodes to come.

    Raises:
        UserError: if there are no such processors or priority, or the system does not permit it.
    """
    try:
        if cpus is not None:
            processors(cpus)
            os.environ[CPUS_VARIABLE] = cpus
        if priority is not None:
            if not 1 <= priority <= 99:
                raise UserError(f"--realtime {priority}: give a priority from 1 to 99", WRONG_USE)
            os.environ[PRIORITY_VARIABLE] = str(priority)
            check_permission(wanted_priority())
    except RealtimeError as error:
        raise UserError(str(error), WRONG_USE) from error


def given_parameters(plan: Any, arguments: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """Return what the options say of the nodes' parameters, by node.

    Raises:
        UserError: if the run has no such node, or something is given twice.
    """
    found: dict[str, dict[str, Any]] = {}
    options = {
        ("indenter", "scenario"): arguments.scenario,
        ("indenter", "seed"): arguments.seed,
        ("indenter", "rate"): arguments.rate,
        ("estimator", "filter"): arguments.filter,
        ("estimator", "state_space"): arguments.state_space,
    }
    kinds = {"indenter": "rig", "estimator": "estimator"}
    for (kind, name), value in options.items():
        if value is None:
            continue
        if not plan.of_kind(kind):
            option = name.replace("_", "-")
            raise UserError(
                f"--{option} given, but the configuration starts no {kinds[kind]}", WRONG_USE
            )
        for node in plan.of_kind(kind):
            found.setdefault(node.name, {})[name] = value
    names = [node.name for node in plan.nodes]
    for text, value in arguments.param:
        nodes, name = targets(text, plan)
        for node in nodes:
            if node == NODE_RECORDER and name in SET_BY_THE_RUN:
                raise UserError(f"--param {text}: {SET_BY_THE_RUN[name]}", WRONG_USE)
            if name in found.setdefault(node, {}):
                raise UserError(f"--param {text}: {name} is given twice", WRONG_USE)
            found[node][name] = value
    rigs = [node.name for node in plan.of_kind("indenter")]
    if arguments.rate not in (None, 1.0):
        # The system's clock goes at one pace only.
        for name in rigs:
            found[name].setdefault("time", "simulated")
    simulated = [r for r in rigs if found.get(r, {}).get("time", "system") != "system"]
    if simulated and len(rigs) > 1:
        raise UserError(f"{' and '.join(rigs)} would each tell the time of /clock", WRONG_USE)
    if simulated:
        for name in names:  # else their clock seems to be another one than that of the samples
            if name not in simulated:
                found.setdefault(name, {}).setdefault("use_sim_time", True)
    return found


def check_state_folders(plan: Any) -> None:
    """See that no two estimators keep what they have learnt in one folder.

    Raises:
        UserError: if two do.
    """
    keepers: dict[str, str] = {}
    for node in plan.of_kind("estimator"):
        folder = str((file_parameters(node) | dict(node.parameters)).get("state.folder", ""))
        other = keepers.setdefault(os.path.abspath(folder), node.name) if folder else node.name
        if other != node.name:
            raise UserError(
                f"{other} and {node.name} keep their states in one folder, {folder}: give each a "
                "state.folder of its own",
                WRONG_USE,
            )


def wants_page(arguments: argparse.Namespace) -> bool:
    """Whether the live page is served: where it was asked for, or where somebody sits."""
    if arguments.dashboard is not None:
        return bool(arguments.dashboard)
    quiet = arguments.headless or arguments.json
    asked = arguments.control or arguments.allow_origin
    return bool(asked) or (sys.stderr.isatty() and not quiet)


def with_dashboard(plan: Any, arguments: argparse.Namespace) -> Any:
    """Return a plan in which the live page is served; a page that dies does not end the run.

    The token goes by the environment: parameters can be read by every node, and what a bag says of
    its run is for everybody.
    """
    from hc_bringup.dashboard.security import TOKEN_VARIABLE, new_token
    from hc_bringup.plan import NodePlan
    from hc_msgs_py.topics import NODE_DASHBOARD

    if plan.of_kind(NODE_DASHBOARD):
        return plan
    os.environ.setdefault(TOKEN_VARIABLE, new_token())
    # Of several estimators it shows the first: it looks at the topics of its namespace.
    first = next(iter(plan.of_kind("estimator")), None)
    space = "" if first is None else first.namespace
    page = NodePlan(
        f"{space}/{NODE_DASHBOARD}" if space else NODE_DASHBOARD,
        "hc_bringup.dashboard.node",
        parameters=dashboard.node_parameters(arguments),
        respawn=True,
    )
    return dataclasses.replace(plan, nodes=(*plan.nodes, page))


def scenario_name(plan: Any) -> str:
    """Return the name of the rig's scenario; empty without a rig."""
    settings = rig_settings(plan)
    return "" if settings is None else Path(settings["scenario"]).stem


def rig_settings(plan: Any) -> dict[str, Any] | None:
    """Return the settings of a run's rig, the scenario's name among them; None without a rig."""
    rig = plan.node("indenter")
    if rig is None:
        return None
    settings = file_parameters(rig) | dict(rig.parameters)
    return settings | {"scenario": str(settings.get("scenario", "multisine"))}


def new_bag_folder(given: str | None, option: str = "--bag") -> Path:
    """Return the absolute path of a bag folder that does not exist yet.

    Args:
        given: what the user said, nothing for a folder with the date.
        option: the option that says it.

    Raises:
        UserError: if the folder exists or cannot be made.
    """
    folder = Path(given or f"bags/run_{datetime.now():%Y%m%d_%H%M%S}").absolute()
    if folder.exists():
        raise UserError(f"{folder} exists already: choose another folder with {option}", WRONG_USE)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"cannot make {folder.parent}: {error.strerror}", WRONG_USE) from error
    return folder


def custom_data(plan: Any, scenario: Any) -> list[str]:
    """Return what a bag's metadata say of the run: nothing of this machine.

    Args:
        plan: the run.
        scenario: of its rig (hc_sim_rig.scenario.Scenario); None without a rig.

    Returns:
        Entries of the form key=value: the configuration, and scenario and seed of the rig.
    """
    configuration = [
        {
            "name": node.name,
            "module": node.module,
            "parameter_files": [file.name for file in node.parameter_files],
            "parameters": dict(node.parameters),
        }
        for node in plan.nodes
    ]
    entries = [f"configuration={json.dumps(configuration, sort_keys=True)}"]
    settings = rig_settings(plan)
    if settings is not None:
        seed = settings.get("seed", scenario.seed)
        entries += [f"scenario={Path(settings['scenario']).name}", f"seed={seed}"]
    return entries


def rig_scenario(plan: Any) -> Any:
    """Return the scenario of a run's rig (hc_sim_rig.scenario.Scenario); None without a rig.

    Raises:
        UserError: if it cannot be read.
    """
    from hc_sim_rig.scenario import load_scenario
    from hc_sim_rig.schema import ScenarioError

    settings = rig_settings(plan)
    if settings is None:
        return None
    try:
        return load_scenario(settings["scenario"])
    except (ScenarioError, OSError) as error:
        raise UserError(str(error), WRONG_USE) from error


def file_parameters(node: Any) -> dict[str, Any]:
    """Return what the parameter files of a node say; later files win."""
    merged: dict[str, Any] = {}
    for file in node.parameter_files:
        data = read_yaml(file)
        for values in sections_for(data if isinstance(data, dict) else {}, f"/{node.name}"):
            if isinstance(values, dict):
                merged.update(values)
    return merged


def with_parameters(plan: Any, node_name: str, parameters: dict[str, Any]) -> Any:
    """Return a plan in which a node has further parameters, which win over the files."""
    return dataclasses.replace(
        plan,
        nodes=tuple(
            dataclasses.replace(node, parameters={**node.parameters, **parameters})
            if node.name == node_name
            else node
            for node in plan.nodes
        ),
    )
