"""Asks the estimator beside the slave for the surface, and keeps where its zero is."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

from hc_msgs.msg import EstimatorConfiguration, EstimatorEvent
from rcl_interfaces.srv import GetParameters
from rclpy.node import Node
from std_srvs.srv import Trigger

from hc_msgs_py.qos import CONFIGURATION_QOS, SERVICE_QOS
from hc_msgs_py.topics import CONFIGURATION, EVENTS, NODE_ESTIMATOR

LOOK_PERIOD_S = 0.1
ASK_PERIOD_S = 1.0
"""Between two requests."""
PATIENCE_S = 10.0
"""For so long an answer is waited for (asked twice, a busy estimator searches twice), and a tool
that is never free (what the slave knows may be wrong)."""
ZERO = "input.position.zero"


class EstimatorZeros:
    """Where the estimator's displacement is zero; asked for anew when it begins anew.

    Attributes:
        searching: whether the estimator says that it looks for the surface.
        found: whether the estimator's zeros are to be believed.
        zero_mm: position of its zero [mm]; None while it is not known.
        lives: times that an estimator began without what the one before it knew.
    """

    def __init__(self, node: Node, find_surface: bool, is_free: Callable[[], bool]) -> None:
        """Listen to the estimator; ask nothing before `begin`.

        Args:
            node: the slave.
            is_free: whether the tool is free of contact, as far as the slave knows: a search that
                begins in a press may take the press for free motion.
            find_surface: have the surface found at the first approach; else its zeros are taken
                as they are.
        """
        self._is_free = is_free
        self._asked_s, self._wait_s = -math.inf, 0.0
        self._find_surface = find_surface
        self._begun = self.searching = self._fresh = self._waits_for_answer = False
        self._revision = self.lives = 0
        self.found = not find_surface
        self.zero_mm: float | None = None
        self._surface_client = node.create_client(
            Trigger, f"{NODE_ESTIMATOR}/find_surface", qos_profile=SERVICE_QOS
        )
        self._zero_client = node.create_client(
            GetParameters, f"{NODE_ESTIMATOR}/get_parameters", qos_profile=SERVICE_QOS
        )
        node.create_subscription(EstimatorEvent, EVENTS, self._on_event, CONFIGURATION_QOS)
        node.create_subscription(
            EstimatorConfiguration, CONFIGURATION, self._on_configuration, CONFIGURATION_QOS
        )
        node.create_timer(LOOK_PERIOD_S, self._ask)

    def begin(self) -> None:
        """Ask from now on: the tool moves."""
        self._begun = True

    def hold_for(self, revision: int) -> bool:
        """Whether the zero that is known is that of an estimate's configuration."""
        return self.zero_mm is not None and revision == self._revision

    def _ask(self) -> None:
        """Ask the estimator for what is not known, until it says so."""
        now_s = time.monotonic()
        period_s = PATIENCE_S if self._waits_for_answer else ASK_PERIOD_S
        if not self._begun or now_s < self._asked_s + period_s:
            return
        if not self.found:
            ready = not self.searching and self._surface_client.service_is_ready()
            if ready:
                self._wait_s += LOOK_PERIOD_S
            if ready and (self._is_free() or self._wait_s > PATIENCE_S):
                self._wait_s = 0.0
                self._asked_s, self._waits_for_answer = now_s, True
                future = self._surface_client.call_async(Trigger.Request())
                future.add_done_callback(self._on_asked)
        elif self.zero_mm is None:
            self._asked_s = now_s
            self._ask_zero()

    def _on_asked(self, future: Any) -> None:
        self._waits_for_answer = False
        self.searching = bool(future.result().success)

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
        if not (self.found or self.searching):
            return
        if message.kind == EstimatorEvent.TARED:
            self.found = True
            self._renew(message.configuration_revision)
        elif message.kind == EstimatorEvent.TARE_REFUSED:
            self.searching = False

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
                self.found, self.searching = not self._find_surface, False
                self._asked_s, self._waits_for_answer = -math.inf, False
        self._renew(message.revision)

    def _renew(self, revision: int) -> None:
        """The zero may be another one from a revision on."""
        self._revision = revision
        self.zero_mm = None
        if self.found:
            self._ask_zero()
