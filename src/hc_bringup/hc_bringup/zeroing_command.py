"""What `hc tare` and `hc find-surface` have in common: call, wait for the outcome, print it."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.options import positive

SERVICES = ("tare", "find_surface")
CONTACT = "input.contact."


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
    from hc_bringup.live_check import settings_of
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
        said: list[str] = []

        def tell(feels: str) -> None:
            said.append(feels)
            heartbeat.telling(waiting, f"{service}: {feels}")

        event = estimator.outcome(is_ours, timeout_s, tell)
        if event is None:
            heartbeat.nothing()
            limit = "" if timeout_s is None else f" within {timeout_s:g} s"
            contact = settings_of(graph, estimator.node, CONTACT) if timeout_s is not None else {}
            why = "".join(f"; {reason}" for reason in why_none(said, contact))
            raise UserError(
                f"no zeros were found{limit}{why}; the estimator goes on looking", FAILURE
            )
    heartbeat.nothing()
    if event.kind == EstimatorEvent.TARE_REFUSED:
        raise UserError(f"refused: {event.reason}", FAILURE)
    print(event.reason)
    return 0


def why_none(said: Sequence[str], contact: Mapping[str, Any]) -> list[str]:
    """Return why no zeros came, as far as that can be told.

    Args:
        said: what the estimator felt meanwhile, once a second.
        contact: its settings by name below `input.contact.`; none if not asked for.
    """
    from hc_estimator.stream.surface import PRESSES

    reasons = []
    pressed = [feels for feels in said if feels.startswith(PRESSES)]
    if pressed and pressed[-1] != said[-1]:
        reasons.append(f"in its last press it felt: {pressed[-1]}")
    if said:
        reasons.append(f"it feels now: {said[-1]}")
    if not pressed and contact.get("frame") == "surface":
        normal = ", ".join(f"{component:.3g}" for component in contact.get("normal", ()))
        reasons.append(
            f"force and depth are read along input.contact.normal ({normal}), and a press across "
            "it is not seen (docs/node.md, Six axes)"
        )
    return reasons
