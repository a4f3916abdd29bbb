"""What a running node gives up, subscriptions and publishers, is destroyed once nobody has it.

rclpy destroys a subscription at once, while its executor still has events for it in its queue: the
next one ends the node with "InvalidHandle: cannot use Destroyable because destruction was
requested". Here a node first takes it out of its lists, so that the executor lets go of it, and
destroys it some time later. This also holds for those that rclpy itself gives up, as the one of
/clock when use_sim_time is switched off.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

ROUNDS = 3
"""Calls of `destroy_retired` before a retired object is destroyed.

The executor updates its set in an event that is queued when the object is retired; a timer's event
that is queued after another event of that timer has run comes behind that one.
"""


class LateDestruction:
    """Base class to stand before rclpy's Node; call `destroy_retired` from a timer.

    What was retired may be called by the executor until then: a callback must bear that.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self._retired: list[tuple[int, Callable[[], None]]] = []
        self._round = 0
        self._ending = False
        super().__init__(*arguments, **options)

    @property
    def retired(self) -> int:
        """Number of objects that wait for their destruction."""
        return len(self._retired)

    def destroy_subscription(self, subscription: Any) -> bool:
        """Take a subscription out of use now, and destroy it later."""
        self._retire(subscription)
        return bool(super().destroy_subscription(subscription))  # type: ignore[misc]

    def destroy_publisher(self, publisher: Any) -> bool:
        """Take a publisher out of use now, and destroy it later."""
        self._retire(publisher)
        return bool(super().destroy_publisher(publisher))  # type: ignore[misc]

    def destroy_retired(self) -> None:
        """Destroy what was given up long enough ago; called now and then by the executor."""
        self._round += 1
        while self._retired and self._retired[0][0] + ROUNDS <= self._round:
            self._retired.pop(0)[1]()

    def destroy_node(self) -> None:
        """Destroy the node with all that it ever had; no executor has it any more."""
        self._ending = True
        while self._retired:
            self._retired.pop(0)[1]()
        super().destroy_node()  # type: ignore[misc]

    def _retire(self, entity: Any) -> None:
        if not self._ending:
            self._retired.append((self._round, entity.destroy))
            entity.destroy = _leave  # what Node.destroy_... calls at once


def _leave() -> None:
    """Destroy nothing yet."""
