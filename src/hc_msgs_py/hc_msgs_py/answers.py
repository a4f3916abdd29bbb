"""Answers of a node's services whose clients are gone: given up, before they stop the node.

An answer waits for a tenth of a second for its client to be seen (rmw_fastrtps), in case it is
new, and nothing else of the process gets on meanwhile, for rclpy keeps the interpreter's lock.
Whoever sends many requests and ends, or is killed, leaves up to a thousand of them in the queue
(SERVICE_QOS): answered one by one, they kept a node from its samples for more than a minute.

So of a client that was waited for in vain no other request of the same time is answered. Who asked
stands in the header of the request; rclpy shows the number beside it alone (rmw_request_id_t). It
is read from that object's memory, where its number is found again behind it, and else not at all:
then every answer is sent, as rclpy would.
"""

from __future__ import annotations

import ctypes
import sys
import time
import warnings
from collections.abc import Callable
from typing import Any, Final

LONGEST_S: Final = 60.0
"""So long at most answers are given up: a clock may have been set back meanwhile."""
_MOST_CLIENTS: Final = 100
"""That are remembered; the earliest is forgotten first."""
_NOT_SENT: Final = "failed to send response"
"""How rclpy begins its warning of an answer that found nobody."""
_NAME_BYTES: Final = 16
_NUMBER_BYTES: Final = 8
_OF_PYBIND: Final = object.__basicsize__ + 5 * ctypes.sizeof(ctypes.c_void_p)
"""Bytes of an object of pybind11: the pointer to what it stands for, its holder, and two more."""


def give_up_on_clients_that_are_gone(node: Any) -> None:
    """Let the services of an rclpy.node.Node leave out answers that nobody waits for any more."""
    for service in node.services:
        service.send_response = _Answers(
            service.send_response, service.srv_name, node.get_logger().warning
        )


def client_of(header: Any) -> bytes:
    """Return the name (GUID) of the client of whose request a header is; empty if it is not known.

    Args:
        header: of a request, as rclpy has it (rmw_service_info_t).
    """
    request: Any = getattr(header, "request_id", None)
    kind = type(request)
    if kind.__name__ != "rmw_request_id_t" or kind.__basicsize__ != _OF_PYBIND:
        return b""
    place = ctypes.c_void_p.from_address(id(request) + object.__basicsize__).value
    if not place:
        return b""
    held = ctypes.string_at(place, _NAME_BYTES + _NUMBER_BYTES)
    number = int.from_bytes(held[_NAME_BYTES:], sys.byteorder, signed=True)
    return held[:_NAME_BYTES] if number == request.sequence_number else b""


class _Answers:
    """Sends the answers of one service.

    Args:
        send: sends one, with its header; warns (RuntimeWarning) where it found nobody.
        name: of the service.
        tell: told of each client of which answers are given up.
    """

    def __init__(
        self, send: Callable[[Any, Any], None], name: str, tell: Callable[[str], Any]
    ) -> None:
        self._send, self._name, self._tell = send, name, tell
        self._gone: dict[bytes, tuple[int, float, bool]] = {}
        # by client: what came until then, by the system's clock [ns], is not answered, until then
        # by one that nobody sets [s]; and whether that was told

    def __call__(self, response: Any, header: Any) -> None:
        """Send an answer, or leave it out.

        Args:
            response: the answer.
            header: of its request.
        """
        client = client_of(header)
        until_ns, until_s, is_said = self._gone.get(client, (-1, 0.0, False))
        if header.received_timestamp <= until_ns and time.monotonic() < until_s:
            if not is_said:
                self._gone[client] = until_ns, until_s, True
                self._tell(
                    f"a client of {self._name} is gone: what else it asked is done and not answered"
                )
            return
        if not self._finds_somebody(response, header) and client:
            self._gone.pop(client, None)
            self._gone[client] = time.time_ns(), time.monotonic() + LONGEST_S, is_said
            if len(self._gone) > _MOST_CLIENTS:
                del self._gone[next(iter(self._gone))]

    def _finds_somebody(self, response: Any, header: Any) -> bool:
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            self._send(response, header)
        found = True
        for warning in said:
            if str(warning.message).startswith(_NOT_SENT):
                found = False
            else:
                warnings.warn_explicit(
                    warning.message, warning.category, warning.filename, warning.lineno
                )
        return found
