"""The topics indenter/sample and indenter/samples as the node's input; what all inputs share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

from hc_msgs.msg import IndenterSample, IndenterSamples
from rclpy.node import Node

from hc_estimator.ros.channel import Channel
from hc_estimator.stream.normal_finder import NormalFinder
from hc_estimator.stream.readings import Suspicion
from hc_estimator.stream.taken_off import TakenOff
from hc_estimator.stream.vocabulary import Batch
from hc_msgs_py.topics import SAMPLE, SAMPLES
from hc_msgs_py.wire import SampleDecoder
from hc_msgs_py.wire_arrays import Samples, SamplesDecoder, decode_samples


class Receiver(Protocol):
    """Who takes the samples: the node."""

    def on_sample(
        self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float
    ) -> None:
        """Take in a sample."""

    def on_samples(self, batch: Batch) -> None:
        """Take in samples that wait together."""

    def fewest_together(self) -> int:
        """Return how many samples it likes better as a batch than one by one now, 2 at least."""

    def on_skip(self, number: int) -> None:
        """Hear that samples were left out, and their numbers with them."""

    def on_frame(self, frame_id: str) -> None:
        """Hear that the samples are in another frame from now on."""

    def on_failure(self, error: Exception) -> None:
        """Hear that a message could not be dealt with for a fault of this program."""


class Input(Protocol):
    """What the node needs of an input.

    Attributes:
        position: newest position of the tip [m] and its frame; None when no pose is received.
        undecodable: messages that were none.
        normal_finder: gets the force vectors while it is there; None if nobody looks for a normal,
            or the input has no such vectors.
        problems: what is wrong with it although samples come, a sentence each.
    """

    position: tuple[tuple[float, float, float], str] | None
    undecodable: int
    normal_finder: NormalFinder | None

    @property
    def channels(self) -> Sequence[Channel]:
        """The topics that it listens to."""

    @property
    def problems(self) -> Sequence[str]:
        """See above: as it is now."""

    @property
    def doubts(self) -> Sequence[Suspicion]:
        """What is suspicious of its messages, which shows in no sample."""

    @property
    def counters(self) -> Mapping[str, int]:
        """What the input itself counted, for diagnostics."""

    def missing_listeners(self) -> list[str]:
        """Say who is not there of those who are to get the samples that it makes."""

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other settings that do not need other subscriptions."""

    def close(self) -> None:
        """Stop listening; a message that was on its way is not handed on."""


class SampleInput:
    """Subscribes to indenter/sample and hands every sample on, less zeros and the robot's yield.

    Samples that wait are decoded together and handed on as one batch.
    """

    def __init__(self, node: Node, receiver: Receiver, values: Mapping[str, Any]) -> None:
        """Start listening.

        Raises:
            SubscriptionError: if the topic cannot be subscribed to.
        """
        self.position: tuple[tuple[float, float, float], str] | None = None
        self.undecodable = 0
        self.normal_finder: NormalFinder | None = None
        self.problems: tuple[str, ...] = ()
        self.doubts: tuple[Suspicion, ...] = ()
        self._receiver = receiver
        self._decoder = SampleDecoder()
        self._frame_id = ""
        self._taken_off = TakenOff()
        self._channel = self._subscribe(node, receiver)
        self.channels = (self._channel,)
        self.configure(values)

    def _subscribe(self, node: Node, receiver: Receiver) -> Channel:
        return Channel(
            node,
            IndenterSample,
            SAMPLE,
            self._take,
            skip=receiver.on_skip,
            fail=receiver.on_failure,
            raw=True,
            take_many=self._take_many,
            fewest=receiver.fewest_together,
        )

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other zeros and another limit of the backlog."""
        self._taken_off.configure(values)
        self._channel.maximum_backlog = values["input.maximum_backlog"]

    @property
    def counters(self) -> Mapping[str, int]:
        """Messages that were none."""
        return {"undecodable": self.undecodable}

    def missing_listeners(self) -> list[str]:
        """Return nothing: the samples are another's."""
        return []

    def close(self) -> None:
        """Stop listening."""
        self._channel.close()

    def _take(self, data: bytes) -> None:
        decoder = self._decoder
        try:
            stamp_ns, sequence, displacement_mm, force_n = decoder.decode(data)
        except ValueError:
            self.undecodable += 1
            return
        self._hear_frame(decoder.frame_id)
        self._hand_on_one(stamp_ns, sequence, displacement_mm, force_n)

    def _take_many(self, messages: list[bytes]) -> None:
        samples = decode_samples(self._decoder, messages)
        if samples is None or self._decoder.frame_id != self._frame_id:
            for message in messages:
                self._take(message)
        else:
            self._hand_on(samples)

    def _hear_frame(self, frame_id: str) -> None:
        if frame_id != self._frame_id:
            self._frame_id = frame_id
            self._receiver.on_frame(frame_id)

    def _hand_on(self, samples: Samples) -> None:
        stamps, sequences, displacements, forces = samples
        if len(stamps) >= self._receiver.fewest_together():
            places, pushes = self._taken_off.of_many(stamps, displacements, forces)
            self._receiver.on_samples(Batch(stamps, sequences, places, pushes))
            return
        columns = (column.tolist() for column in samples)
        for stamp_ns, sequence, displacement_mm, force_n in zip(*columns, strict=True):
            # Zeros that one of them sets hold from the next one on.
            self._hand_on_one(stamp_ns, sequence, displacement_mm, force_n)

    def _hand_on_one(
        self, stamp_ns: int, sequence: int, displacement_mm: float, force_n: float
    ) -> None:
        given = self._taken_off.of_one(stamp_ns, displacement_mm, force_n)
        self._receiver.on_sample(stamp_ns, sequence, *given)


class ArrayInput(SampleInput):
    """Subscribes to indenter/samples: each message is a batch."""

    def _subscribe(self, node: Node, receiver: Receiver) -> Channel:
        self._arrays = SamplesDecoder()
        self._per_message = 1
        return Channel(
            node,
            IndenterSamples,
            SAMPLES,
            self._take,
            skip=receiver.on_skip,
            fail=receiver.on_failure,
            raw=True,
            samples_in=self._samples_in,
        )

    def configure(self, values: Mapping[str, Any]) -> None:
        """Take other zeros and another limit of the backlog, which counts samples."""
        super().configure(values)
        self._maximum_backlog = values["input.maximum_backlog"]
        self._limit()

    def _limit(self) -> None:
        self._channel.maximum_backlog = max(1, self._maximum_backlog // self._per_message)

    def _samples_in(self, data: bytes) -> int:
        try:
            return len(SamplesDecoder().decode(data).stamps_ns)
        except ValueError:
            return 0

    def _take(self, data: bytes) -> None:
        try:
            samples = self._arrays.decode(data)
        except ValueError:
            self.undecodable += 1
            return
        if len(samples.stamps_ns) != self._per_message:
            self._per_message = len(samples.stamps_ns)
            self._limit()
        self._hear_frame(self._arrays.frame_id)
        self._hand_on(samples)


def missing_publishers(channels: Sequence[Channel], expected: int) -> list[str]:
    """Say of each topic that has fewer publishers than expected how many it has."""
    return [
        why_unmatched(channel) or f"{channel.topic} has {found} of {expected} publishers"
        for channel in channels
        if (found := channel.publishers) < expected
    ]


def why_unmatched(channel: Channel) -> str:
    """Say why whoever publishes a topic is not heard: another type, or quality of service."""
    names = channel.publisher_names
    others = [name for name in names if name.endswith(")")]
    if others:
        return f"{channel.topic} is {channel.type_name} here, but is published by {others[0]}"
    if names and not channel.publishers:
        return (
            f"{channel.topic} is published by {names[0]} with a quality of service that does not "
            f"fit: qos_overrides.{channel.topic}.subscription, and hc topic info {channel.topic} -v"
        )
    return ""


def publisher_conflict(channels: Sequence[Channel]) -> str:
    """Say which topics have more publishers than are followed, and who is; nothing if none has."""
    return "; ".join(
        f"{channel.publishers} publishers on {channel.topic} "
        f"({', '.join(channel.publisher_names)}): follows the one that was first"
        for channel in channels
        if channel.crowded
    )
