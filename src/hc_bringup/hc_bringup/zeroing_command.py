"""What `hc tare` and `hc find-surface` have in common: call, wait for the outcome, print it."""

from __future__ import annotations

import argparse
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.options import positive

SERVICES = ("tare", "find_surface")


def configure(parser: argparse.ArgumentParser, *, timeout: str) -> None:
    """Declare the options."""
    from hc_bringup.service_calls import add_node_option

    add_node_option(parser)
    parser.add_argument(
        "--force", action="store_true", help="take the zeros although the tool presses or moves"
    )
    parser.add_argument("--timeout", type=positive, metavar="S", help=timeout)


def run(arguments: argparse.Namespace, service: str, timeout_s: float | None) -> int:
    """Call the service, wait until the zeros are there, and print them."""
    from hc_msgs.msg import EstimatorEvent

    from hc_bringup.graph import Graph
    from hc_bringup.service_calls import EstimatorServices

    with Graph() as graph:
        heartbeat.doing(f"calling {service} of {arguments.node}")
        estimator = EstimatorServices(graph, arguments.node)
        estimator.listen()

        def ask() -> str:
            return estimator.trigger(service)

        def is_ours(event: Any) -> bool:
            # What another client asked for before may have given way to this.
            given_up = f"{other} given up: "
            return event.kind in kinds and not event.reason.startswith(given_up)

        kinds = (EstimatorEvent.TARED, EstimatorEvent.TARE_REFUSED)
        other = next(name for name in SERVICES if name != service)
        answer = estimator.with_parameter("tare.force", True, ask) if arguments.force else ask()
        print(answer, flush=True)
        waiting = f"waiting for the outcome of {service}"
        heartbeat.doing(waiting)
        event = estimator.outcome(
            is_ours, timeout_s, lambda feels: heartbeat.telling(waiting, f"{service}: {feels}")
        )
    heartbeat.nothing()
    if event is None:
        limit = "" if timeout_s is None else f" within {timeout_s:g} s"
        raise UserError(f"no zeros were found{limit}; the estimator goes on looking", FAILURE)
    if event.kind == EstimatorEvent.TARE_REFUSED:
        raise UserError(f"refused: {event.reason}", FAILURE)
    print(event.reason)
    return 0
