"""One run in a ROS domain at a time: two would take each other's samples for their own.

The lock (named_lock.py) has the domain's name. It holds across users, within the network that the
nodes speak over.
"""

from __future__ import annotations

import socket
from types import TracebackType

from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.named_lock import owner_of, take
from hc_bringup.process_state import is_stopped
from hc_msgs_py import middleware

HIGHEST_DOMAIN = 101
"""Above it the ports of DDS leave the range that Linux keeps free."""


def domain_id() -> int:
    """Return the ROS domain of this process.

    Raises:
        UserError: if ROS_DOMAIN_ID is not a number that a domain can have.
    """
    try:
        return middleware.domain_id()
    except middleware.NoDomainError as error:
        raise UserError(str(error), WRONG_USE) from error


class DomainLock:
    """Has a domain for the time of a run. Use as a context manager."""

    def __init__(self, domain: int) -> None:
        self._domain = domain
        self._socket: socket.socket | None = None

    def __enter__(self) -> DomainLock:
        """Take the domain.

        Raises:
            UserError: if another run has it; names its process, and a domain that is free.
        """
        self._socket = take(_name(self._domain))
        if self._socket is None:
            number, owner = owner_of(_name(self._domain))
            free = next((d for d in range(1, HIGHEST_DOMAIN + 1) if _is_free(d)), None)
            way_out = "end it first"
            if number is not None and _seems_stopped(number):
                way_out = f"it is stopped: kill -CONT {number} lets it go on, kill -9 ends it"
            if free is not None:
                way_out += f", or take another domain: ROS_DOMAIN_ID={free} hc ..."
            way_out += " (a second robot in this one: a node in a namespace, docs/node.md, Limits)"
            raise UserError(
                f"{owner} has a run in ROS domain {self._domain} already, and two would mix "
                f"their samples: {way_out}",
                FAILURE,
            )
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        if self._socket is not None:
            self._socket.close()


def elsewhere_hint() -> str:
    """Return for the end of a message in which other domains of this machine there are runs.

    Two terminals with another ROS_DOMAIN_ID each see nothing of each other. Empty without one.
    """
    own = domain_id()
    owners = {d: owner_of(_name(d)) for d in range(HIGHEST_DOMAIN + 1) if d != own}
    found = {d: words for d, (number, words) in owners.items() if number is not None}
    if not found:
        return ""
    runs = ", ".join(f"{words} in domain {domain}" for domain, words in found.items())
    return f"; this is ROS domain {own}, and there is {runs}: ROS_DOMAIN_ID={min(found)} hc ..."


def _name(domain: int) -> str:
    return f"hc_run_in_ros_domain_{domain}"


def _is_free(domain: int) -> bool:
    listener = take(_name(domain))
    if listener is not None:
        listener.close()
    return listener is not None


def _seems_stopped(number: int) -> bool:
    try:
        return is_stopped(number)
    except OSError:  # it has ended just now
        return False
