"""Listens to the estimates of one estimator, message by message or in arrays, and counts them."""

from __future__ import annotations

import math
import time
from functools import partial
from typing import Any, Final

from hc_msgs.msg import EstimatorConfiguration, HuntCrossleyEstimate

from hc_bringup.dashboard.parsing import EstimatesParser
from hc_bringup.dashboard.taps import Arrival, Taps
from hc_bringup.statistics import EstimateStatistics, estimate_rows
from hc_logger.type_names import ESTIMATES_TYPE
from hc_msgs_py.conversion import configuration_from_message
from hc_msgs_py.qos import CONFIGURATION_QOS, ESTIMATE_QOS
from hc_msgs_py.topics import CONFIGURATION, ESTIMATE, ESTIMATES

ARRAYS_S: Final = 1.0
"""Whoever told estimates on hc/estimate so lately is not listened to on hc/estimates as well."""


class EstimateListener:
    """Hears one estimator.

    Attributes:
        statistics: of its estimates.
        last_at: when the last one came, by time.monotonic; 0 before it.
    """

    def __init__(self, name: str) -> None:
        """Prepare.

        Args:
            name: of the estimator, with its namespace: its topics are there.
        """
        self._namespace = name.rpartition("/")[0]
        self.statistics = EstimateStatistics()
        self.last_at = self._alone_at = 0.0  # the second: of hc/estimate

    def full_name(self, topic: str) -> str:
        """Return the name of one of the estimator's topics."""
        return f"/{self._namespace}/{topic}".replace("//", "/")

    def listen(self, node: Any, taps: Taps) -> None:
        """Begin.

        Args:
            node: whose subscriptions they are.
            taps: of the node.
        """
        estimate, configuration = map(self.full_name, (ESTIMATE, CONFIGURATION))
        node.create_subscription(HuntCrossleyEstimate, estimate, self._on_estimate, ESTIMATE_QOS)
        node.create_subscription(
            EstimatorConfiguration, configuration, self._on_configuration, CONFIGURATION_QOS
        )
        taps.acquire(
            self.full_name(ESTIMATES),
            ESTIMATES_TYPE,
            partial(self._on_arrays, EstimatesParser()),
            local=False,
            reliable=True,
        )

    def silent_s(self) -> float:
        """Return the time since the last estimate; NaN before the first one."""
        return time.monotonic() - self.last_at if self.last_at else math.nan

    def _on_estimate(self, message: Any) -> None:
        self.statistics.add(message)
        self.last_at = self._alone_at = time.monotonic()

    def _on_arrays(self, parser: EstimatesParser, arrivals: list[Arrival]) -> None:
        table, _stamps = parser.parse(arrivals)
        now = time.monotonic()
        if now - self._alone_at < ARRAYS_S:
            return  # they come on both topics
        for row in estimate_rows(table):
            self.statistics.add(row)
        self.last_at = now if len(table) else self.last_at

    def _on_configuration(self, message: Any) -> None:
        configuration = configuration_from_message(message)
        self.statistics.touch.configure(configuration.parameters, configuration.revision)
