"""Datagrams, clock offset and the link of a live teleoperation, with a clock of our own."""

from __future__ import annotations

import math
import random
import socket
import struct
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_sim_rig.bilateral.clock_offset import ClockOffset
from hc_sim_rig.bilateral.datagrams import MASTER, NEVER, SIZE, SLAVE, Datagram, decode
from hc_sim_rig.bilateral.udp_link import Added, Clocks, LinkError, UdpLink

MS = 1_000_000
HERE = "127.0.0.1"
TISSUE = (0.25, 0.006, 1.6, 0.9, 0.0)


def a_datagram(**changed: object) -> Datagram:
    given = Datagram(SLAVE, 7, 5, 3, 4, 1.0, -2.0, 3.0, 0.5, TISSUE, (0.1,) * 5, 0.2, True)
    return given._replace(**changed)


# Datagrams.


def test_a_datagram_comes_back_as_it_went() -> None:
    assert decode(a_datagram().encode()) == a_datagram()
    without = decode(Datagram(MASTER, 0, 0, NEVER, NEVER, 0.0, 0.0, 0.0, 0.0).encode())
    assert math.isnan(without.model[0])
    assert without.relative_std == math.inf


@pytest.mark.parametrize(
    ("changed", "word"),
    [
        ({"position_mm": math.nan}, "motion"),
        ({"force_n": math.inf}, "motion"),
        ({"model": (1.0, math.nan, 1.0, 1.0, 0.0)}, "model"),
        ({"model": (-1.0, 0.0, 1.0, 1.0, 0.0)}, "model"),
        ({"model": (21.0, 0.0, 1.0, 1.0, 0.0)}, "model's K is 21, not within 0.0001 to 20"),
        ({"model": (1.0, 6.0, 1.0, 1.0, 0.0)}, "model's B is 6"),
        ({"model": (1.0, 0.0, 5.0, 1.0, 0.0)}, "model's n is 5"),
        ({"model": (1.0, 0.0, 1.0, 0.1, 0.0)}, "model's p is 0.1"),
        ({"model": (1.0, 0.0, 1.0, 1.0, math.inf)}, "model's surface"),
        ({"model": (math.nan,) * 5}, "sure of no model"),
        ({"deviations": (0.1, 0.1, 0.1, 0.1, -0.1)}, "standard deviation"),
        ({"relative_std": math.nan}, "standard deviation"),
        ({"side": 9}, "side"),
        ({"method": 4}, "method 4"),
        ({"wave": math.inf}, "waves"),
        ({"wave_energy_mj": -1.0}, "waves"),
        ({"wave_impedance": 0.0}, "waves"),
    ],
)
def test_what_cannot_be_is_refused(changed: dict, word: str) -> None:
    with pytest.raises(ValueError, match=word):
        decode(a_datagram(**changed).encode())


@given(st.binary(max_size=2 * SIZE))
def test_any_bytes_are_a_datagram_or_refused(data: bytes) -> None:
    whole = a_datagram().encode()
    for given_bytes in (data, (whole[:8] + data + whole[8:])[:SIZE]):
        try:
            found = decode(given_bytes)
        except ValueError:
            continue
        assert all(map(math.isfinite, (found.position_mm, found.velocity_mm_s, found.force_n)))


# The clock.


@pytest.mark.parametrize("asymmetry", [0.5, 0.2, 0.9])
def test_the_offset_is_right_within_the_bound(asymmetry: float) -> None:
    """Another clock 123 s ahead that drifts by 50 ppm; ways of any asymmetry, with jitter."""
    dice = random.Random(1)
    clock = ClockOffset()
    assert clock.bound_ns(0) == math.inf
    arrivals = []
    for k in range(1, 5000):
        there = round(asymmetry * 100 * MS + dice.expovariate(1 / (5 * MS)))
        back = round((1.0 - asymmetry) * 100 * MS + dice.expovariate(1 / (5 * MS)))
        arrivals.append((k * MS + there + 3 * MS + back, k * MS, there))
    error = 0.0
    for arrival, sent, there in sorted(arrivals):
        middle = sent + there
        true_offset = 123e9 + 5e-5 * middle
        t2 = round(middle + true_offset)
        clock.add(sent, t2, t2 + 3 * MS, arrival)
        error = abs(clock.offset_ns - true_offset)
        assert error <= clock.bound_ns(arrival) + 1e-4 * 500 * MS
    assert clock.exchanges == 4999
    assert clock.steps == 0
    assert error < abs(asymmetry - 0.5) * 100 * MS + 2 * MS  # the asymmetry is all that is left
    assert clock.bound_ns(5000 * MS) < 52 * MS


def test_a_clock_that_is_set_is_followed_and_counted() -> None:
    clock = ClockOffset()
    for k in range(2000):
        offset = 0 if k < 1000 else 30_000 * MS
        t1 = k * MS
        clock.add(t1, t1 + 5 * MS + offset, t1 + 6 * MS + offset, t1 + 11 * MS)
    assert clock.steps == 1
    assert clock.offset_ns == pytest.approx(30_000 * MS)


def test_an_exchange_that_ends_before_it_began_is_none() -> None:
    clock = ClockOffset()
    clock.add(10, 0, 100, 20)
    assert not clock.known


# The link.


def exchange(links: tuple[UdpLink, UdpLink], count: int, begin: int = 0) -> None:
    master, slave = links
    for k in range(begin, begin + count):
        for link in (master, slave):
            link.receive(k * MS)
            link.send(a_datagram(position_mm=float(k)), k * MS)


def test_the_newest_datagram_counts(links: tuple[UdpLink, UdpLink]) -> None:
    master, slave = links
    assert math.isinf(master.age_s(0))
    assert math.isinf(master.silence_s(0))
    exchange(links, 50)
    assert slave.newest is not None
    assert slave.newest.side == MASTER
    assert slave.newest.position_mm == 49.0
    assert master.newest is not None
    assert master.newest.position_mm == 48.0
    assert (slave.lost, slave.overtaken, slave.refused) == (0, 0, 0)
    assert slave.clock.exchanges > 40
    assert master.silence_s(1049 * MS) == pytest.approx(1.0)


def test_added_delay_loss_and_overtaking(links: tuple[UdpLink, UdpLink]) -> None:
    master, slave = links
    master._added = Added(0.02, 0.003, 0.3)
    exchange(links, 2000)
    assert slave.newest is not None
    assert 1990.0 - slave.newest.position_mm < 40.0
    assert slave.overtaken > 100
    assert slave.received == pytest.approx(1400, abs=80)
    assert slave.lost == pytest.approx(600, abs=80)
    assert slave.age_s(2000 * MS) == pytest.approx(0.02, abs=0.015)
    # one way alone is late: half of it is what the exchange cannot know, and the bound says so
    assert abs(slave.clock.offset_ns) <= slave.clock.bound_ns(2000 * MS)


def test_strangers_and_nonsense_are_refused(links: tuple[UdpLink, UdpLink]) -> None:
    master, slave = links
    port = slave.port
    slave.close()
    for place in (("127.0.0.2", port), (HERE, 0)):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            stranger.bind(place)
            stranger.sendto(a_datagram(side=SLAVE).encode(), (HERE, master.port))
            came = stranger.getsockname()
        master.receive(0)
        assert f"comes from {came[0]}:{came[1]}, not from {HERE}:{port}" in master.why_refused
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as neighbour:
        neighbour.bind((HERE, port))
        for data in (b"", b"x" * SIZE, b"y" * 5000, a_datagram(side=MASTER).encode()):
            neighbour.sendto(data, (HERE, master.port))
    master.receive(0)
    assert master.refused == 6
    assert master.newest is None
    assert "two masters" in master.why_refused


@pytest.mark.parametrize("set_ms", [0, 3_600_000, -3_600_000])
def test_another_side_that_starts_again_is_followed(
    links: tuple[UdpLink, UdpLink], set_ms: int
) -> None:
    """Numbers begin anew, and its clock may have been set; what its former life sent is dropped."""
    master, slave = links
    exchange(links, 100)
    late = a_datagram(life=slave._life, sequence=5000, sent_ns=10**18).encode()
    port = slave.port
    slave.close()
    again = UdpLink(SLAVE, HERE, port, HERE, master.port, Added(), 1)
    for k in range(500, 520):
        master.receive(k * MS)
        master.send(a_datagram(), k * MS)
        again.receive((k + set_ms) * MS)
        again.send(a_datagram(position_mm=float(k)), (k + set_ms) * MS)
        again._put(late)
    assert master.newest is not None
    assert master.newest.position_mm == 518.0
    assert (master.lost, master.restarts) == (0, 1)
    assert master.silence_s(520 * MS) < 0.002
    assert master.clock.offset_ns == pytest.approx(set_ms * MS, abs=2 * MS)
    again.close()


@pytest.mark.parametrize("set_ms", [3_600_000, -3_600_000])
def test_a_clock_that_is_set_makes_nobody_deaf_or_dumb(set_ms: int) -> None:
    """Of this side: what is held back leaves in time, and silence is noticed."""
    steady, system = [0], [0]
    clocks = Clocks(lambda: system[0], lambda: steady[0])
    first = UdpLink(MASTER, HERE, 0, HERE, 1, Added(), 1)
    second = UdpLink(SLAVE, HERE, 0, HERE, first.port, Added(), 1)
    port = first.port
    first.close()
    delayed = Added(delay_s=0.02)
    first = UdpLink(MASTER, HERE, port, HERE, second.port, delayed, 1, clocks)
    for k in range(200):
        steady[0] = k * MS
        here = system[0] = (k + (set_ms if k >= 100 else 0)) * MS
        first.receive(here)
        first.send(a_datagram(position_mm=float(k)), here)
        if k < 150:
            second.receive(k * MS)
            second.send(a_datagram(), k * MS)
    second.receive(200 * MS)
    assert second.newest is not None
    assert second.newest.position_mm == 179.0
    assert first.silence_s(here) == pytest.approx(0.05, abs=0.003)
    assert first.clock.steps == 1
    assert first.clock.offset_ns == pytest.approx(-set_ms * MS, abs=15 * MS)
    first.close()
    second.close()


def test_a_side_that_is_held_up_takes_nobodys_clock_for_set() -> None:
    """Its time is read, it has to wait, and what comes meanwhile came later than that time."""
    system = [0]
    clocks = Clocks(lambda: system[0], lambda: system[0])
    first = UdpLink(MASTER, HERE, 0, HERE, 1, Added(), 1)
    second = UdpLink(SLAVE, HERE, 0, HERE, first.port, Added(), 1, clocks)
    port = first.port
    first.close()
    first = UdpLink(MASTER, HERE, port, HERE, second.port, Added(), 1, clocks)
    dice = random.Random(1)
    for k in range(2000):
        system[0] = k * MS
        first.receive(k * MS)
        first.send(a_datagram(), k * MS)
        read_ns = (k - (dice.randrange(1, 40) if dice.random() < 0.05 else 0)) * MS
        second.receive(read_ns)
        second.send(a_datagram(), read_ns)
    for link in (first, second):
        assert link.clock.steps == 0
        assert link.clock.exchanges > 1900
        assert abs(link.clock.offset_ns) <= link.clock.bound_ns(2000 * MS)
        link.close()


def test_numbers_do_not_begin_anew_after_49_days(links: tuple[UdpLink, UdpLink]) -> None:
    master, slave = links
    slave.sent = 2**32 - 10
    exchange(links, 100)
    assert master.newest is not None
    assert master.newest.position_mm == 98.0


def test_a_link_that_cannot_be_is_one_line() -> None:
    with pytest.raises(LinkError, match=r"link from 192\.0\.2\.1:5"):
        UdpLink(MASTER, "192.0.2.1", 5, HERE, 6, Added(), 1)


def test_struct_size_is_what_the_page_says() -> None:
    page = (Path(__file__).parents[2] / "docs" / "teleoperation.md").read_text(encoding="utf-8")
    assert f"{SIZE} bytes" in page
    assert struct.calcsize("<4sBBHIQqqq4d3d5d5dd") == SIZE
