"""From topics to the page: estimates and samples to rows and map, and the status of all.

What comes once a second or less is always listened to (`rare_messages`); the streams of a thousand
messages a second only while a page is open, and a while longer, so that a page that is loaded
again finds its past.
"""

from __future__ import annotations

import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray
from rclpy.node import Node

from hc_bringup.dashboard.columns import INDEX
from hc_bringup.dashboard.digest import Digest
from hc_bringup.dashboard.latency import LatencyWindow
from hc_bringup.dashboard.palpation import PalpationMap
from hc_bringup.dashboard.parsing import EstimatesParser, RecordParser
from hc_bringup.dashboard.rare_messages import RareMessages
from hc_bringup.dashboard.server import DashboardServer
from hc_bringup.dashboard.taps import Arrival, Taps
from hc_bringup.dashboard.taxels import ARRAY_TYPE, TaxelMap, arrays_of, chosen_array
from hc_bringup.explanation import BackgroundExplainer, RecentMotion
from hc_bringup.statistics import estimate_rows
from hc_bringup.zero_effect import DeepestTouch
from hc_msgs_py.interface_class import UnknownInterfaceError
from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE, TACTILE_ESTIMATE, TIP, TRUTH
from hc_msgs_py.units import METRE_IN_MM

GRACE_S: Final = 10.0
"""The streams are still listened to so long after the last page was closed."""
STATUS_PERIOD_S: Final = 0.25
MAP_PERIOD_S: Final = 0.2
LOOK_PERIOD_S: Final = 1.0
"""Between two looks at who publishes."""
FLUSH_S: Final = 0.1
"""Without messages for so long, the row that is not complete is shown."""
RATE_SPAN_S: Final = 1.0
ARRAYS_S: Final = 1.0
"""Whoever told estimates in arrays so lately is not listened to on hc/estimate as well."""
MOTION_EVERY: Final = 4
"""Of so many estimates one is remembered to explain a misfit by."""

_TYPES = {
    ESTIMATE: "hc_msgs/msg/HuntCrossleyEstimate",
    ESTIMATES: "hc_msgs/msg/HuntCrossleyEstimates",
    SAMPLE: "hc_msgs/msg/IndenterSample",
    TRUTH: "hc_msgs/msg/IndenterTruth",
}
_TIP_FIELDS = {
    "geometry_msgs/msg/PointStamped": "point.",
    "geometry_msgs/msg/PoseStamped": "pose.position.",
}


@dataclass
class _Counts:
    """Running totals of what arrived while somebody looked."""

    estimates: int = 0
    lost: int = 0
    rejected: int = 0
    recent: deque[tuple[float, int]] = field(default_factory=deque)

    def rate_hz(self, now_s: float) -> float:
        while self.recent and now_s - self.recent[0][0] > RATE_SPAN_S:
            self.recent.popleft()
        return sum(number for _, number in self.recent) / RATE_SPAN_S


class Feed:
    """Listens to the suite for the page; `tick` is called thirty times a second."""

    def __init__(
        self,
        node: Node,
        taps: Taps,
        server: DashboardServer,
        *,
        tip_topic: str = "",
        axes: str = "xy",
    ) -> None:
        """Listen to what is rare.

        Args:
            node: the node that listens.
            taps: its subscriptions.
            server: who shows what comes.
            tip_topic: where the tip's position is published; empty takes indenter/tip.
            axes: which two of its components are sideways.
        """
        self._node, self._taps, self._server = node, taps, server
        self._axes = axes
        self._names = {
            name: node.resolve_topic_name(name) for name in (*_TYPES, TACTILE_ESTIMATE, TIP)
        }
        if tip_topic:
            self._names[TIP] = node.resolve_topic_name(tip_topic)
        self._digest = Digest()
        self._map = PalpationMap()
        self._map_version = self._map.version
        self._taxels = TaxelMap()
        self._taxels_version = 0
        self._latency = LatencyWindow()
        self._motion = RecentMotion()
        self._explainer = BackgroundExplainer()
        self._touch = DeepestTouch()
        self._latest: NDArray[Any] | None = None
        self._mismatch = False
        self._counts = _Counts()
        self._parsers: dict[str, RecordParser | EstimatesParser] = {
            name: EstimatesParser() if name == ESTIMATES else RecordParser(kind)
            for name, kind in _TYPES.items()
        }
        self._arrays_at = -ARRAYS_S
        self._acquired: dict[str, tuple[str, Any, int]] = {}
        self._viewers = 0
        self._nobody_since = -GRACE_S
        self._streaming = False
        self._last_data: float | None = None
        self._next = dict.fromkeys(("status", "map", "look"), 0.0)
        self.last_stamp_ns = 0
        self.last_sequence = 0
        self.extra_status: dict[str, Any] = {}
        self.rare = RareMessages(node, taps, server, self._place)

    @property
    def streaming(self) -> bool:
        """Whether the streams are listened to."""
        return self._streaming

    def set_viewers(self, number: int) -> None:
        """Take note of how many pages are open."""
        if self._viewers and not number:
            self._nobody_since = time.monotonic()
        self._viewers = number

    def tick(self) -> None:
        """Take in what has arrived, and tell the pages."""
        now = time.monotonic()
        wanted = self._viewers > 0 or now - self._nobody_since < GRACE_S
        if wanted != self._streaming:
            self._streaming = wanted
            self._next["look"] = 0.0
            if not wanted:
                self._release_all()
                self._show(self._digest.pause())
        if wanted and self._due("look", LOOK_PERIOD_S, now):
            self._look()
        self._taps.drain()
        if not self._viewers:
            return
        if self._last_data is not None and now - self._last_data > FLUSH_S:
            self._show(self._digest.flush())
        if self._due("map", MAP_PERIOD_S, now):
            self._show_maps()
        if self._due("status", STATUS_PERIOD_S, now):
            self._server.publish_text("status", self._status(now))

    def _show_maps(self) -> None:
        if self._map.version != self._map_version:
            self._map_version = self._map.version
            self._server.publish_map(self._digest.epoch, self._map.cell_mm, self._map.table())
        if self._taxels.version != self._taxels_version:
            self._taxels_version = self._taxels.version
            self._server.publish_taxels(self._taxels.cell_mm, self._taxels.table())

    def clear_map(self) -> None:
        """Forget what was felt so far."""
        self._map.clear()

    def _due(self, what: str, period_s: float, now: float) -> bool:
        if now < self._next[what]:
            return False
        self._next[what] = now + period_s
        return True

    # Which streams there are.

    def _look(self) -> None:
        """Listen to the streams that somebody publishes: samples only while nobody estimates."""
        estimated = self._taps.publishers(self._names[ESTIMATE]) > 0
        # The arrays first: the taps are emptied in this order, and what they told counts once.
        self._want(ESTIMATES, _TYPES[ESTIMATES], self._on_arrays, wanted=estimated)
        self._want(ESTIMATE, _TYPES[ESTIMATE], self._on_estimates, wanted=estimated)
        self._want(SAMPLE, _TYPES[SAMPLE], self._on_samples, wanted=not estimated)
        # Of the truth the latest of each turn is enough: it is shown at the rate of the page.
        self._want(TRUTH, _TYPES[TRUTH], self._on_truth, wanted=True, depth=1)
        kinds_of = dict(self._node.get_topic_names_and_types())
        if TACTILE_ESTIMATE not in self._acquired:
            own = self._node.resolve_topic_name(TACTILE_ESTIMATE)
            found = [n for n in arrays_of(kinds_of) if self._taps.publishers(n) > 0]
            self._names[TACTILE_ESTIMATE] = chosen_array(found, own)
        self._want(TACTILE_ESTIMATE, ARRAY_TYPE, self._taxels.take, wanted=True, depth=1)
        kinds = kinds_of.get(self._names[TIP], [])
        kind = next((kind for kind in kinds if kind in _TIP_FIELDS), None)
        if kind is not None and TIP not in self._acquired:
            self._parsers[TIP] = RecordParser(kind)
            self._tip_field = _TIP_FIELDS[kind]
        self._want(TIP, kind or "", self._on_tip, wanted=kind is not None)

    def _want(
        self, name: str, type_name: str, take: Any, *, wanted: bool, depth: int = 2000
    ) -> None:
        topic = self._names[name]
        wanted = wanted and self._taps.publishers(topic) > 0
        if wanted and name not in self._acquired:
            try:
                self._taps.acquire(topic, type_name, take, depth=depth, local=False)
            except UnknownInterfaceError as error:
                self._node.get_logger().warning(str(error))
                return
            self._acquired[name] = (topic, take, depth)
        elif not wanted and name in self._acquired:
            topic, take, depth = self._acquired.pop(name)
            self._taps.release(topic, take, depth=depth)

    def _release_all(self) -> None:
        for topic, take, depth in self._acquired.values():
            self._taps.release(topic, take, depth=depth)
        self._acquired.clear()

    # What the streams say.

    def _on_arrays(self, arrivals: list[Arrival]) -> None:
        self._arrays_at = time.monotonic()
        self._estimated(*self._parsers[ESTIMATES].parse(arrivals))

    def _on_estimates(self, arrivals: list[Arrival]) -> None:
        if time.monotonic() - self._arrays_at >= ARRAYS_S:  # else they come on both topics
            self._estimated(*self._parsers[ESTIMATE].parse(arrivals))

    def _estimated(self, table: NDArray[Any], stamps: NDArray[np.int64]) -> None:
        if len(table):
            self._latency.add(table["latency"], time.monotonic())
            self._counts.rejected += int(np.count_nonzero(table["rejected"]))
            self._mismatch = bool(table["model_mismatch"][-1])
            part = np.flatnonzero(np.isfinite(table["force_measured"]))[::MOTION_EVERY]
            for stamp, depth, force, revision in zip(
                stamps[part],
                table["displacement"][part],
                table["force_measured"][part],
                table["configuration_revision"][part],
                strict=True,
            ):
                depth_mm = float(depth) * METRE_IN_MM
                self._motion.add(float(stamp) * 1e-9, depth_mm, float(force), int(revision))
            self._take_in(table, stamps, estimates=True)
            self._touched(table)

    def _touched(self, table: NDArray[Any]) -> None:
        self._latest = table[-1:]
        revision = int(table["configuration_revision"][-1])
        inside = table["contact"].astype(bool) & (table["rejected"] == 0)
        depths = table["displacement"][inside & (table["configuration_revision"] == revision)]
        if len(depths):
            self._touch.add(float(np.nanmax(depths, initial=0.0)) * METRE_IN_MM, revision)

    def _zero_effect(self) -> str:
        """What zeros that are off would make of the K that is shown, in words."""
        if self._latest is None:
            return ""
        self._touch.configure(self.rare.settings, self.rare.configuration.get("revision", 0))
        return self._touch.effect(next(estimate_rows(self._latest))).sentence

    def _on_samples(self, arrivals: list[Arrival]) -> None:
        table, stamps = self._parsers[SAMPLE].parse(arrivals)
        if len(table):
            self._take_in(table, stamps, estimates=False)

    def _take_in(self, table: NDArray[Any], stamps: NDArray[np.int64], *, estimates: bool) -> None:
        now = time.monotonic()
        self._last_data = now
        self._counts.estimates += len(table)
        self._counts.recent.append((now, len(table)))
        self.last_stamp_ns, self.last_sequence = int(stamps[-1]), int(table["sequence"][-1])
        self._show(self._digest.add(table, stamps, estimates=estimates))

    def _show(self, rows: NDArray[np.float64]) -> None:
        if self._digest.epoch != self._shown_epoch:
            self._shown_epoch = self._digest.epoch
            self._map.clear()
            self._counts = _Counts()
        if len(rows):
            self._counts.lost += int(rows[:, INDEX["lost"]].sum())
            self._map.add_rows(rows)
            self._server.publish_rows(self._digest.epoch, rows)

    _shown_epoch = 0

    def _on_truth(self, arrivals: list[Arrival]) -> None:
        table, stamps = self._parsers[TRUTH].parse(arrivals)
        if len(table):
            self._digest.set_truth(table[-1], int(stamps[-1]))

    def _on_tip(self, arrivals: list[Arrival]) -> None:
        table, stamps = self._parsers[TIP].parse(arrivals)
        origin = self._digest.origin_ns
        if origin is None or not len(table):
            return
        x, y = (table[self._tip_field + axis] * METRE_IN_MM for axis in self._axes)
        for stamp, at_x, at_y in zip(stamps, x, y, strict=True):
            self._map.add_tip(float(stamp - origin) * 1e-9, float(at_x), float(at_y))
        self._digest.set_tip(float(x[-1]), float(y[-1]))

    def _place(self, contact: dict[str, Any]) -> None:
        """Put a contact on the map where the estimator knows its position, if no tip is shown."""
        self._touch.add(contact["peak_depth"], contact["revision"])
        if TIP in self._acquired:
            return
        x, y = (contact["position"]["xyz".index(axis)] for axis in self._axes)
        stiffness, _damping, exponent, _power = contact["parameters"]
        if not (np.isfinite(x) and np.isfinite(y) and stiffness > 0.0):
            return
        parameters = (
            np.log(stiffness),
            exponent,
            (contact["std"][0] / stiffness) ** 2,
            contact["std"][2] ** 2,
            contact["stiffness_exponent_covariance"] / stiffness,
        )
        self._map.place_contact(x, y, np.array(parameters), contact["peak_depth"])

    def _status(self, now: float) -> dict[str, Any]:
        return {
            "epoch": self._digest.epoch,
            "origin": None if self._digest.origin_ns is None else self._digest.origin_ns * 1e-9,
            "silent_s": None if self._last_data is None else max(0.0, now - self._last_data),
            "estimating": ESTIMATE in self._acquired,
            "tip": TIP in self._acquired,
            "taxels": self._taxels.status,
            "rate_hz": self._counts.rate_hz(now),
            "estimates": self._counts.estimates,
            "lost": self._counts.lost,
            "rejected": self._counts.rejected,
            "latency": self._latency.counts(now),
            "viewers": self._viewers,
            "explanation": self._explainer.explain(self._motion, self._mismatch),
            "zero_effect": self._zero_effect(),
            "configuration": self.rare.configuration,
            "nodes": self.rare.health(now),
            **self.extra_status,
        }
