"""Publishers of the node and what they send: estimate, wrench, configuration, events, contacts.

Estimates go out as bytes: hc_msgs_py.wire says why.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import (
    ContactSummary,
    EstimatorConfiguration,
    EstimatorEvent,
    HuntCrossleyEstimate,
    HuntCrossleyEstimates,
)
from numpy.typing import NDArray
from rclpy.node import Node

from hc_estimator import Estimate, EstimateSeries, Estimator, __version__
from hc_estimator.ros.estimate_arrays import EstimateArraysEncoder
from hc_estimator.ros.estimate_messages import EstimateEncoder, fill_contact
from hc_estimator.stream import contacts
from hc_estimator.stream.latency import LatencyClock
from hc_estimator.stream.vocabulary import LOADED_STATE, Batch, Event, Revision
from hc_msgs_py.conversion import (
    Configuration,
    fill_event,
    fill_force,
    message_from_configuration,
)
from hc_msgs_py.qos import CONFIGURATION_QOS, ESTIMATE_QOS
from hc_msgs_py.topics import (
    CONFIGURATION,
    CONTACTS,
    ESTIMATE,
    ESTIMATES,
    EVENTS,
    FRAME_INDENTER_TIP,
    RECONSTRUCTED_WRENCH,
)
from hc_msgs_py.wire import publish_bytes
from hc_msgs_py.wire_arrays import Samples, encode_estimates

EACH: Final = "each"
ARRAYS: Final = "arrays"


class Outputs:
    """The node's publishers, which live as long as the node.

    Attributes:
        frame_id: frame of the samples.
        form: each, arrays or both: an hc/estimate a sample, or an hc/estimates a batch.
        wrenches_left_out: of samples that waited together, all but the last.
        wrench_wanted: whether somebody listens to the wrench, as `look_who_listens` saw it last.
    """

    def __init__(self, node: Node) -> None:
        self._estimate = node.create_publisher(HuntCrossleyEstimate, ESTIMATE, ESTIMATE_QOS)
        self._wrench = node.create_publisher(WrenchStamped, RECONSTRUCTED_WRENCH, ESTIMATE_QOS)
        self._configuration = node.create_publisher(
            EstimatorConfiguration, CONFIGURATION, CONFIGURATION_QOS
        )
        self._events = node.create_publisher(EstimatorEvent, EVENTS, CONFIGURATION_QOS)
        self._contacts = node.create_publisher(ContactSummary, CONTACTS, CONFIGURATION_QOS)
        self._arrays = node.create_publisher(HuntCrossleyEstimates, ESTIMATES, ESTIMATE_QOS)
        self._encoder = EstimateEncoder()
        self._arrays_encoder = EstimateArraysEncoder()
        self.form = EACH
        self._clock = node.get_clock()
        self._latency = LatencyClock()
        self._wrench_message = WrenchStamped()
        self.wrench_wanted = False
        self.wrenches_left_out = 0
        self.frame_id = ""
        self.set_frame(FRAME_INDENTER_TIP)

    def set_frame(self, frame_id: str) -> None:
        """Name the frame of the samples in what is published from now on."""
        self.frame_id = frame_id
        self._encoder.set_frame(frame_id)
        self._arrays_encoder.set_frame(frame_id)
        self._wrench_message.header.frame_id = frame_id

    def look_who_listens(self) -> None:
        """Ask who listens; called now and then, because asking costs as much as publishing."""
        self.wrench_wanted = self._wrench.get_subscription_count() > 0

    @property
    def estimate_topic(self) -> str:
        """hc/estimate, or hc/estimates where only that is published."""
        return ESTIMATES if self.form == ARRAYS else ESTIMATE

    @property
    def estimate_subscribers(self) -> int:
        """Matched subscribers of `estimate_topic`."""
        publisher = self._arrays if self.form == ARRAYS else self._estimate
        return int(publisher.get_subscription_count())

    def publish_estimate(
        self,
        stamp_ns: int,
        sequence: int,
        force_n: float,
        estimate: Estimate,
        computation_ns: int,
        revision: int,
    ) -> int:
        """Publish an estimate, and its force as a wrench where somebody wants it.

        Returns:
            The latency [ns]: from the stamp to now, by the node's clock; that the system's clock
            is set meanwhile does not count.
        """
        latency_ns = self._latency_of(stamp_ns)
        if self.form != EACH:
            one = np.array([stamp_ns]), np.array([sequence]), np.empty(1), np.array([force_n])
            rows = np.array([estimate.values])
            self._publish_arrays(Batch(*one), rows, computation_ns, latency_ns, revision)
            if self.form == ARRAYS:
                self._publish_wrench(stamp_ns, estimate.force_reconstructed)
                return latency_ns
        data = self._encoder.encode(
            estimate,
            stamp_ns,
            sequence,
            force_n,
            revision,
            computation_ns * 1e-9,
            latency_ns * 1e-9,
        )
        publish_bytes(self._estimate, (data,))
        self._publish_wrench(stamp_ns, estimate.force_reconstructed)
        return latency_ns

    def publish_estimates(
        self, batch: Batch, series: EstimateSeries, computation_ns: int, revision: int
    ) -> list[int]:
        """Publish the estimates of samples that were taken in together.

        Args:
            batch: the samples, no more than a message holds (hc_msgs_py.wire_arrays).
            series: their estimates.
            computation_ns: wall time for one of them [ns].
            revision: of the configuration.

        Returns:
            The latencies [ns].
        """
        count = len(batch.stamps_ns)
        newest_ns = int(batch.stamps_ns[-1])
        latency_ns = self._latency_of(newest_ns)
        now_ns = newest_ns + latency_ns
        if self.form != EACH:
            total_ns = computation_ns * count
            self._publish_arrays(batch, series.values, total_ns, latency_ns, revision)
        if self.form != ARRAYS:
            seconds = computation_ns * 1e-9
            samples = Samples(*batch)
            publish_bytes(
                self._estimate,
                encode_estimates(series, samples, self.frame_id, revision, seconds, now_ns),
            )
        # The wrench is for looking at: of samples that waited the newest will do.
        if self.wrench_wanted:
            self._publish_wrench(int(batch.stamps_ns[-1]), float(series.force_reconstructed[-1]))
            self.wrenches_left_out += count - 1
        latencies: list[int] = (now_ns - batch.stamps_ns).tolist()
        return latencies

    def _latency_of(self, stamp_ns: int) -> int:
        """From a stamp to now [ns]; that the system's clock is set meanwhile does not count."""
        if self._clock.ros_time_is_active:
            return int(self._clock.now().nanoseconds) - stamp_ns
        return self._latency.latency_ns(stamp_ns, time.time_ns(), time.monotonic_ns())

    def _publish_arrays(
        self,
        batch: Batch,
        rows: NDArray[np.float64],
        computation_ns: int,
        latency_ns: int,
        revision: int,
    ) -> None:
        seconds = computation_ns * 1e-9, latency_ns * 1e-9
        data = self._arrays_encoder.encode(batch, rows, revision, *seconds)
        publish_bytes(self._arrays, (data,))

    def _publish_wrench(self, stamp_ns: int, force_n: float) -> None:
        if self.wrench_wanted:
            fill_force(self._wrench_message, stamp_ns, force_n)
            self._wrench.publish(self._wrench_message)

    def publish_configuration(
        self,
        revision: Revision,
        estimator: Estimator,
        zeros: Mapping[str, float | str],
        loaded: Mapping[str, Any] | None = None,
    ) -> None:
        """Publish the configuration in force.

        Args:
            revision: from when on it holds.
            estimator: the estimator that has it.
            zeros: what is subtracted from the samples before the estimator sees them, and how
                else they were read, by parameter name; those that are not zero become part of
                the configuration.
            loaded: the state that the estimator went on from, for a revision that loaded one; it
                becomes part of the configuration, as JSON under the name LOADED_STATE.
        """
        parameters: dict[str, Any] = dict(estimator.configuration)
        parameters |= {name: zero for name, zero in zeros.items() if zero != 0.0}
        if loaded is not None:
            parameters[LOADED_STATE] = json.dumps(loaded)
        self._configuration.publish(
            message_from_configuration(
                Configuration(
                    stamp_ns=self._clock.now().nanoseconds,
                    revision=revision.number,
                    valid_from_sequence=revision.valid_from_sequence,
                    time_origin_ns=revision.time_origin_ns,
                    cause=int(revision.cause),
                    filter=estimator.filter,
                    state_space=estimator.state_space,
                    contact_model=estimator.contact_model,
                    software_version=__version__,
                    parameters=parameters,
                )
            )
        )

    def publish_event(self, event: Event, revision: int) -> None:
        """Publish an event; one that no sample belongs to carries the node's time."""
        message = EstimatorEvent()
        message.header.frame_id = self.frame_id
        stamp_ns = event.stamp_ns or self._clock.now().nanoseconds
        fill_event(message, int(event.kind), stamp_ns, event.sequence, revision, event.reason)
        self._events.publish(message)

    def publish_contact(self, summary: contacts.ContactSummary, revision: int) -> None:
        """Publish the summary of a contact that is over."""
        message = ContactSummary()
        message.header.frame_id = self.frame_id
        fill_contact(message, summary, revision)
        self._contacts.publish(message)
