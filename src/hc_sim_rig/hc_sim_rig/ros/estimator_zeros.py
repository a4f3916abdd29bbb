"""Asks the estimator beside the slave for the surface, and keeps where its zero is."""

from __future__ import annotations

from typing import Any

from hc_msgs.msg import EstimatorConfiguration, EstimatorEvent
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_srvs.srv import Trigger

from hc_msgs_py.qos import CONFIGURATION_QOS
from hc_msgs_py.topics import CONFIGURATION, EVENTS, NODE_ESTIMATOR

ASK_PERIOD_S = 1.0
"""Between two requests that were not answered, or refused."""
ZERO = "input.position.zero"


class EstimatorZeros:
    """Where the estimator's displacement is zero; asked for anew when it begins anew.

    Attributes:
        found: whether the estimator's zeros are to be believed.
        zero_mm: position of its zero [mm]; None while it is not known.
        lives: times that an estimator began without what the one before it knew.
    """

    def __init__(self, node: Node, find_surface: bool) -> None:
        """Listen to the estimator; ask nothing before `begin`.

        Args:
            node: the slave.
            find_surface: have the surface found at the first approach; else its zeros are taken
                as they are.
        """
        self._node = node
        self._find_surface = find_surface
        self._begun = self._searching = self._fresh = False
        self._revision = self.lives = 0
        self.found = not find_surface
        self.zero_mm: float | None = None
        self._surface_client = node.create_client(Trigger, f"{NODE_ESTIMATOR}/find_surface")
        self._zero_client = node.create_client(GetParameters, f"{NODE_ESTIMATOR}/get_parameters")
        node.create_subscription(EstimatorEvent, EVENTS, self._on_event, CONFIGURATION_QOS)
        node.create_subscription(
            EstimatorConfiguration, CONFIGURATION, self._on_configuration, CONFIGURATION_QOS
        )
        node.create_timer(ASK_PERIOD_S, self._ask)

    def begin(self) -> None:
        """Ask from now on: the tool moves."""
        self._begun = True

    def hold_for(self, revision: int) -> bool:
        """Whether the zero that is known is that of an estimate's configuration."""
        return self.zero_mm is not None and revision == self._revision

    def _ask(self) -> None:
        """Ask the estimator for what is not known, until it says so."""
        if not self._begun:
            return
        if not self.found:
            if not self._searching and self._surface_client.service_is_ready():
                future = self._surface_client.call_async(Trigger.Request())
                future.add_done_callback(self._on_asked)
        elif self.zero_mm is None:
            self._ask_zero()

    def _on_asked(self, future: Any) -> None:
        self._searching = bool(future.result().success)

    def _ask_zero(self) -> None:
        if self._zero_client.service_is_ready():
            future = self._zero_client.call_async(GetParameters.Request(names=[ZERO]))
            future.add_done_callback(self._on_zero)

    def _on_zero(self, future: Any) -> None:
        values = future.result().values
        if values and self.found:
            self.zero_mm = float(values[0].double_value)

    def _on_event(self, message: Any) -> None:
        """Zeros were taken, or not; what was before anybody asked does not count."""
        if not (self.found or self._searching):
            return
        if message.kind == EstimatorEvent.TARED:
            self.found = True
            self._renew(message.configuration_revision)
        elif message.kind == EstimatorEvent.TARE_REFUSED:
            self._searching = False

    def _on_configuration(self, message: Any) -> None:
        """The estimator has another configuration, or is another estimator.

        One that goes on from a kept state has its zeros. One that has started says so twice: at
        once, and with its first sample, when its time begins.
        """
        if message.cause == EstimatorConfiguration.STARTED:
            origin = message.time_origin
            again = self._fresh and (origin.sec or origin.nanosec)
            self._fresh = not again
            if not again:
                self.lives += 1
                self.found, self._searching = not self._find_surface, False
        self._renew(message.revision)

    def _renew(self, revision: int) -> None:
        """The zero may be another one from a revision on."""
        self._revision = revision
        self.zero_mm = None
        if self.found:
            self._ask_zero()
