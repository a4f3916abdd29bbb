"""hc lifecycle: the state of a managed node, as `ros2 lifecycle` has it, which the wheels lack."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_msgs_py.nearest import hint

_TRANSITIONS = ("configure", "activate", "deactivate", "cleanup", "shutdown")
HELP = "look at and change the lifecycle state of a managed node (the estimator is one)"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    get = commands.add_parser("get", help="print the state of a node")
    listing = commands.add_parser("list", help="transitions that are possible now")
    change = commands.add_parser("set", help="make a transition")
    for one in (get, listing, change):
        one.add_argument("node", metavar="NODE")
    change.add_argument(
        "transition",
        metavar="TRANSITION",
        help=", ".join(_TRANSITIONS),
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command; status 1 for a transition that was not made."""
    from lifecycle_msgs.srv import (  # type: ignore[import-untyped]
        ChangeState,
        GetAvailableTransitions,
        GetState,
    )

    from hc_bringup.graph import Graph
    from hc_bringup.service_calls import Client

    with Graph() as graph:
        node = graph.require_node(arguments.node)
        if arguments.action == "get":
            state = _ask(graph, GetState, node, "get_state").current_state
            print(f"{state.label} [{state.id}]")
            return 0
        answer = _ask(graph, GetAvailableTransitions, node, "get_available_transitions")
        possible = {t.transition.label: t for t in answer.available_transitions}
        if arguments.action == "list":
            for label, way in possible.items():
                print(f"- {label} [{way.transition.id}]: {way.start_state.label} -> ", end="")
                print(way.goal_state.label)
            return 0
        wanted = possible.get(arguments.transition)
        if wanted is None:
            state = _ask(graph, GetState, node, "get_state").current_state.label
            # What was meant may be impossible now, and is then no other one that sounds alike.
            meant = hint(arguments.transition, _TRANSITIONS, "")
            if not any(meant == hint(word, [word], "") for word in possible):
                meant = f"possible: {', '.join(possible)}"
            raise UserError(
                f"{node} is {state} and cannot {arguments.transition}; {meant}", WRONG_USE
            )
        request = ChangeState.Request()
        request.transition.id = wanted.transition.id
        done = Client(graph, ChangeState, f"{node}/change_state").call(request, 200.0)
        if not done.success:
            raise UserError(f"{node} did not {arguments.transition}", FAILURE)
        print("Transitioning successful")
    return 0


def _ask(graph: Any, kind: Any, node: str, service: str) -> Any:
    from hc_bringup.service_calls import Client

    try:
        return Client(graph, kind, f"{node}/{service}").call(kind.Request())
    except UserError as error:
        raise UserError(f"{node} is no managed node, or does not answer: {error}") from error
