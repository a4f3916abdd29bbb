"""The channel against a plain queue of packets, and its statistics against what was ordered."""

from __future__ import annotations

import dataclasses
import heapq

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from hc_sim_rig import Rig, RigSeries, ScenarioError, load_scenario
from hc_sim_rig.bilateral import Bilateral, Network
from hc_sim_rig.channel_kernel import receive, send
from hc_sim_rig.drives import Channel, Link
from hc_sim_rig.layout import (
    DRAW_BURST,
    DRAW_JITTER,
    DRAW_LOSS,
    DRAWS,
    NO_PACKET,
    PACKET_COLUMNS,
    PACKET_SEQUENCE,
    PACKETS_LOST,
    RING,
)

RATE = 1000.0


def teleoperate(forward: Link, seconds: float = 5.0) -> tuple[RigSeries, Rig]:
    scenario = load_scenario("teleoperation")
    drive = dataclasses.replace(
        scenario.drive, channel=Channel(forward=forward, backward=Link(delay_s=0.03))
    )
    rig = Rig(dataclasses.replace(scenario, drive=drive))
    return rig.run(seconds), rig


def transport(link: Link, seed: int, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Sequence that the receiver has at each tick, by the kernel; the draws; packets lost."""
    generator = np.random.default_rng(seed)
    draws = generator.random((count, DRAWS))
    draws[:, DRAW_JITTER] = generator.standard_normal(count)
    links = np.array([link.constants(), Link().constants()])
    packets = np.zeros((2, PACKET_COLUMNS))
    packets[:, PACKET_SEQUENCE] = NO_PACKET
    ring = np.full((2, RING, 2), NO_PACKET)
    received = np.empty(count)
    for tick in range(count):
        send(0, float(tick), tick, RATE, link.delay_s, links, packets, ring, draws[tick])
        receive(0, tick, links, packets, ring)
        received[tick] = packets[0, PACKET_SEQUENCE]
    return received, draws, int(packets[0, PACKETS_LOST])


def plain_queue(link: Link, draws: np.ndarray) -> np.ndarray:
    """The same channel as a heap of packets, written independently."""
    queue: list[tuple[int, int]] = []
    has, last_arrival, burst = NO_PACKET, 0, False
    received = []
    for tick, draw in enumerate(draws):
        if burst:
            burst = not draw[DRAW_BURST] < 1.0 / link.burst_packets
        else:
            burst = bool(draw[DRAW_BURST] < link.burst_probability)
        if not burst and not draw[DRAW_LOSS] < link.loss:
            delay = link.delay_s + link.jitter_s * np.clip(draw[DRAW_JITTER], -6, 6)
            delay += link.variation_s * np.sin(2 * np.pi * link.variation_hz * tick / RATE)
            arrival = tick + max(0, round(delay * RATE))
            if not link.overtaking:
                arrival = last_arrival = max(arrival, last_arrival)
            heapq.heappush(queue, (arrival, tick))
        arrived = []
        while queue and queue[0][0] <= tick:
            arrived.append(heapq.heappop(queue)[1])
        if arrived:
            latest = max(arrived)
            if link.receiver == "last_arrived" or latest > has:
                has = latest
        received.append(has)
    return np.array(received)


@settings(max_examples=40)
@given(
    delay=st.floats(0.0, 0.06),
    jitter=st.floats(0.0, 0.02),
    share=st.floats(0.0, 1.0),
    loss=st.floats(0.0, 0.5),
    burst=st.floats(0.0, 0.05),
    overtaking=st.booleans(),
    receiver=st.sampled_from(["newest", "last_arrived"]),
    seed=st.integers(0, 1000),
)
def test_the_channel_is_a_queue_of_packets(
    delay: float,
    jitter: float,
    share: float,
    loss: float,
    burst: float,
    overtaking: bool,
    receiver: str,
    seed: int,
) -> None:
    link = Link(
        delay_s=delay,
        variation_s=share * delay,
        variation_hz=3.0,
        jitter_s=jitter,
        loss=loss,
        burst_probability=burst,
        burst_packets=5.0,
        overtaking=overtaking,
        receiver=receiver,
    )
    received, draws, _ = transport(link, seed, 400)
    np.testing.assert_array_equal(received, plain_queue(link, draws))


def test_a_constant_delay_shifts_by_whole_samples() -> None:
    series, rig = teleoperate(Link(delay_s=0.125))
    np.testing.assert_array_equal(
        series.coupling.command_mm[125:], series.master.position_mm[:-125]
    )
    assert np.all(series.coupling.command_mm[:125] == 0.0)
    np.testing.assert_array_equal(series.coupling.feedback_force_n[30:], series.truth.force_n[:-30])
    assert rig.link_reports()[0] == (0, 0)


def test_a_varying_delay_stays_within_its_bounds() -> None:
    link = Link(delay_s=0.1, variation_s=0.05, variation_hz=0.5, jitter_s=0.002)
    received, _, _ = transport(link, 1, 6000)
    age = (np.arange(6000) - received)[500:] / RATE
    assert 0.049 - 0.012 <= age.min() < 0.055
    assert 0.14 < age.max() <= 0.151 + 0.012


def test_the_newest_receiver_never_goes_back() -> None:
    link = Link(delay_s=0.05, jitter_s=0.01)
    received, _, _ = transport(link, 2, 3000)
    assert np.all(np.diff(received) >= 0.0)
    as_they_come, _, _ = transport(dataclasses.replace(link, receiver="last_arrived"), 2, 3000)
    assert np.any(np.diff(as_they_come) < 0.0)
    in_order, _, _ = transport(
        dataclasses.replace(link, receiver="last_arrived", overtaking=False), 2, 3000
    )
    assert np.all(np.diff(in_order) >= 0.0)


def test_losses_are_as_frequent_as_ordered() -> None:
    _, _, lost = transport(Link(loss=0.2), 3, 5000)
    low, high = stats.binom.ppf([1e-5, 1 - 1e-5], 5000, 0.2)
    assert low < lost < high


def test_bursts_are_as_long_as_ordered() -> None:
    received, _, lost = transport(Link(burst_probability=0.01, burst_packets=20.0), 4, 20000)
    gone = received != np.arange(20000)
    begins = np.flatnonzero(np.diff(gone.astype(int)) == 1)
    assert lost == gone.sum()
    assert 15.0 < lost / len(begins) < 25.0
    assert 0.7 < gone.mean() / (20.0 / 120.0) < 1.3


def test_a_lost_packet_leaves_the_last_value() -> None:
    series, rig = teleoperate(Link(loss=0.5))
    command, master = series.coupling.command_mm, series.master.position_mm
    held = command != master
    assert rig.link_reports()[0].lost == held.sum()
    assert np.array_equal(command[1:][held[1:]], command[:-1][held[1:]])


def test_the_delay_glides_while_the_rig_runs() -> None:
    scenario = load_scenario("teleoperation")
    rig = Rig(scenario)
    rig.run(5.0)
    rig.tune(forward_delay_s=0.05)
    rig.run(2.0)
    series = rig.run(3.0)
    error = [
        np.abs(series.coupling.command_mm[200:] - series.master.position_mm[200 - k : -k]).mean()
        for k in range(20, 150)
    ]
    assert abs(20 + int(np.argmin(error)) - 50) < 15  # variation and jitter stay as they were


def test_a_delay_that_the_rig_cannot_keep_is_refused_while_it_runs_too() -> None:
    """Regression: it was cut to 4095 samples without a word."""
    scenario = dataclasses.replace(load_scenario("teleoperation"), rate_hz=8000.0)
    rig = Rig(scenario)
    with pytest.raises(
        ScenarioError, match=r"channel\.backward can take 0\.515 s, must stay below"
    ):
        rig.tune(backward_delay_s=0.5)
    rig.tune(backward_delay_s=0.4, forward_delay_s=0.0)
    with pytest.raises(ScenarioError, match=r"round_trip_ms is 1000: a packet can take 0\.8 s"):
        Bilateral(rate_hz=8000.0, network=Network(round_trip_ms=1000.0))


def test_delays_that_cannot_be_are_refused() -> None:
    with pytest.raises(ScenarioError, match="variation_s"):
        Link(delay_s=0.1, variation_s=0.2)
    scenario = load_scenario("teleoperation")
    drive = dataclasses.replace(scenario.drive, channel=Channel(forward=Link(delay_s=0.3)))
    with pytest.raises(ScenarioError, match=r"channel\.forward can take 0\.3 s"):
        dataclasses.replace(scenario, drive=drive, rate_hz=20000.0)
