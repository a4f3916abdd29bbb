"""Datagrams, clock offset, link and both live sides, in one process with its own clock."""

from __future__ import annotations

import dataclasses
import math
import random
import socket
import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_sim_rig.bilateral import Bilateral, Feedback, SlaveArm, simulate
from hc_sim_rig.bilateral.clock_offset import ClockOffset
from hc_sim_rig.bilateral.datagrams import MASTER, NEVER, SIZE, SLAVE, Datagram, decode
from hc_sim_rig.bilateral.model_source import ModelSource, SlaveModel
from hc_sim_rig.bilateral.sides import MasterSide, SlaveSide
from hc_sim_rig.bilateral.simulated_hand import SimulatedHand
from hc_sim_rig.bilateral.task import palpation_task, recorded_task
from hc_sim_rig.bilateral.udp_link import Added, Clocks, LinkError, UdpLink
from hc_sim_rig.schema import ScenarioError

MS = 1_000_000
HERE = "127.0.0.1"
TISSUE = (0.25, 0.006, 1.6, 0.9, 0.0)


def a_datagram(**changed: object) -> Datagram:
    given = Datagram(SLAVE, 7, 5, 3, 4, 1.0, -2.0, 3.0, 0.5, TISSUE, (0.1,) * 4, 0.2, True)
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
        ({"deviations": (0.1, -0.1, 0.1, 0.1)}, "standard deviation"),
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


@pytest.fixture
def links() -> Iterator[tuple[UdpLink, UdpLink]]:
    """Master's and slave's end, on ports that are free."""
    first = UdpLink(MASTER, HERE, 0, HERE, 1, Added(), 1)
    port = first.port
    second = UdpLink(SLAVE, HERE, 0, HERE, port, Added(), 1)
    first.close()
    first = UdpLink(MASTER, HERE, port, HERE, second.port, Added(), 1)
    yield first, second
    first.close()
    second.close()


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


# The sides.


def teleoperate(
    links: tuple[UdpLink, UdpLink],
    settings: Bilateral,
    seconds: float,
    known: SlaveModel | None = None,
    from_s: float = 0.0,
) -> dict[str, np.ndarray]:
    """Run both sides in turn with a clock of our own; the model is there from a time on."""
    hand = SimulatedHand(settings, palpation_task(1000.0), 1)
    master, slave = MasterSide(settings, links[0]), SlaveSide(settings, links[1], -5.0, 1)
    rows = {name: [] for name in ("hand", "force", "tool", "true", "update", "tank", "stiffness")}
    for k in range(round(seconds * 1000)):
        now = 10**15 + k * MS
        felt = master.step(now, hand.reading_mm(), hand.lateral_mm)
        model = known if known is not None and k >= from_s * 1000 else SlaveModel()
        read = slave.step(now, model)
        hand.move(felt.force_n)
        values = (felt.position_mm, felt.force_n, read.true_position_mm, read.true_force_n)
        values += (felt.update_n, felt.tank_mj, read.stiffness)
        for name, value in zip(rows, values, strict=True):
            rows[name].append(value)
    return {name: np.array(values) for name, values in rows.items()}


def test_the_hand_feels_the_model_and_no_update_jumps(links: tuple[UdpLink, UdpLink]) -> None:
    """The true model is sent from 3 s on, while the hand is in the tissue: nothing jumps."""
    for link in links:
        link._added = Added(0.05, 0.005, 0.1)
    settings = Bilateral()
    known = SlaveModel(TISSUE, (0.01,) * 4, 0.05, True)
    run = teleoperate(links, settings, 6.0, known, from_s=2.3)
    assert np.all(run["force"][:2300] == 0.0)  # nothing is felt before something is known
    assert np.abs(run["update"]).max() <= 20.0 * 1e-3 * (1.0 + 1e-9)
    late = slice(4500, None)
    law = TISSUE[0] * np.maximum(run["hand"], 0.0) ** TISSUE[2]
    press = run["hand"] > 1.0
    assert np.median(np.abs(run["force"] - law)[late][press[late]]) < 0.15
    assert run["tank"].min() > -0.05


def test_bounds_of_the_rendering_hold_at_a_device_that_is_scaled(
    links: tuple[UdpLink, UdpLink],
) -> None:
    """A device whose millimetre is ten of the tool feels ten times the slope and damping."""
    links[1].send(a_datagram(model=(20.0, 0.0, 1.0, 1.0, 0.0)), 0)
    side = MasterSide(Bilateral(), links[0], scale=10.0)
    felt = [
        side.step(k * MS, 10.0 * at_device, 0.0).force_n
        for k, at_device in enumerate(np.linspace(-0.1, 0.5, 6000))
    ]
    slope = np.diff(felt) / (0.6 / 5999)
    assert felt[-1] == pytest.approx(10.0 * 0.5, rel=0.05)
    assert slope.max() < 20.0  # 10 N/mm, and what damping adds at the surface


@pytest.mark.parametrize("every_ms", [1, 10, 40])
def test_readings_that_come_late_look_like_no_speed(
    links: tuple[UdpLink, UdpLink], every_ms: int
) -> None:
    """A device that tells seldom, or a node that was held up; 20 mm/s made 3.5 N of 1.2 before."""
    side = MasterSide(Bilateral(), links[0])
    speeds = []
    for k in range(600):
        read = k - k % every_ms
        new = k % every_ms == 0
        sample = side.step(k * MS, 0.02 * read, 0.0, every_ms * 1e-3 if new else 0.0)
        speeds.append(sample.velocity_mm_s)
    assert max(speeds) <= 20.0 * (1.0 + 1e-6)
    assert speeds[-1] == pytest.approx(20.0, rel=0.01)


def test_the_live_sides_are_the_simulation(links: tuple[UdpLink, UdpLink]) -> None:
    """No delay, force as it comes: as the offline loop, up to its sample of delay and its dice."""
    settings = Bilateral(feedback=Feedback(method="direct"))
    live = teleoperate(links, settings, 8.0)
    offline = simulate(settings, seed=1)
    for name, column in (("hand", offline.master_mm), ("tool", offline.slave_mm)):
        assert np.sqrt(np.mean((live[name] - column[:8000]) ** 2)) < 0.15
    assert live["true"].max() == pytest.approx(offline.tissue_force_n[:8000].max(), rel=0.1)


def test_the_slave_stays_when_nothing_comes_and_follows_no_jump(
    links: tuple[UdpLink, UdpLink],
) -> None:
    master, slave_link = links
    slave = SlaveSide(Bilateral(), slave_link, -5.0, 1)
    places, sideways = [], [0.0]
    for k in range(3000):
        if k < 1000:  # a command that is 20 mm away at once
            master.send(Datagram(MASTER, 0, 0, 0, 0, -25.0, 0.0, 40.0, 0.0), k * MS)
        read = slave.step(k * MS, SlaveModel())
        places.append(read.true_position_mm)
        sideways.append(read.lateral_mm)
    assert np.abs(np.diff(sideways)).max() <= 0.5 + 1e-9
    assert sideways[-1] == 40.0
    steps = np.abs(np.diff(places))
    assert steps.max() < 1.2  # 500 mm/s, and what a step of the velocity overshoots
    assert places[999] == pytest.approx(-25.0, abs=0.1)
    assert abs(places[-1] - places[1600]) < 0.05


def test_only_estimates_that_are_known_become_the_model() -> None:
    source = ModelSource()
    assert math.isnan(source.current.model[0])
    source.feel(1.5, 0.05)
    assert math.isnan(source.current.model[0])
    source.feel(1.5, 0.3)
    assert source.current.model[4] == 1.5
    assert not source.current.sure
    parameters, good = np.array(TISSUE[:4]), np.diag([1e-6] * 4)
    source.take(parameters, good, 0.1, 3.0, 0.01, 7.0)
    assert source.current.sure
    assert source.current.model == (*TISSUE[:4], 0.1)
    source.take(
        2.0 * parameters, np.eye(4), 0.1, 3.0, 0.01, 7.0
    )  # nobody knows: the last one stays
    assert not source.current.sure
    assert source.current.model == (*TISSUE[:4], 0.1)
    source.take(parameters * np.nan, good, 0.1, 3.0, 0.01, 7.0)
    assert not source.current.sure


def test_of_an_estimate_that_grows_old_nobody_is_sure(links: tuple[UdpLink, UdpLink]) -> None:
    """An estimator that died left the slave stiff, and everybody sure, for good."""
    source, hard = ModelSource(), np.array((1.0, *TISSUE[1:4]))
    assert source.age_s(1.0) == math.inf
    arm = SlaveArm(impedance="adaptive")
    slave = SlaveSide(Bilateral(slave=arm), links[1], -1.0, 1)
    for k in range(4000):
        if k < 2000:
            source.take(hard, np.diag([1e-6] * 4), 0.1, 3.0, 0.01, k * 1e-3)
        known = source.at(k * 1e-3)
        assert known.sure == (k <= 2499)
        assert known.model[0] == 1.0  # the last one that counted goes on being felt
        stiffness = slave.step(k * MS, known).stiffness
        links[0].receive(k * MS)
        if k == 2000:
            assert stiffness > 4.0
    assert stiffness == pytest.approx(arm.stiffness_low)
    assert links[0].newest is not None
    assert not links[0].newest.sure


# The controller that adapts; its bounds: test_bilateral_guarantees.py.


def test_stiffness_that_grows_while_stretched_is_paid_for(links: tuple[UdpLink, UdpLink]) -> None:
    """Held away from its command with an empty tank, the spring does not stiffen."""
    arm = SlaveArm(impedance="adaptive", tank_mj=0.0)
    master, slave = links[0], SlaveSide(Bilateral(slave=arm), links[1], 2.0, 1)
    stiff = SlaveModel((2.0, 0.0, 1.5, 1.0, 0.0), sure=True)
    for k in range(1500):
        master.send(Datagram(MASTER, 0, 0, 0, 0, 6.0, 0.0, 0.0, 0.0), k * MS)
        last = slave.step(k * MS, stiff)
    assert last.stiffness == pytest.approx(arm.stiffness_low)


def test_bounds_in_the_wrong_order_are_named() -> None:
    with pytest.raises(ScenarioError, match="stiffness_low is 5"):
        SlaveArm(stiffness_low=5.0, stiffness_high=1.0)


# Recorded motions.


def test_a_recorded_motion_moves_the_hand(tmp_path: Path) -> None:
    path = tmp_path / "motion.csv"
    time = np.arange(0.0, 3.0, 0.01)
    rows = np.column_stack([time, -3.0 + 6.0 * np.sin(time), 0.5 * time])
    np.savetxt(path, rows, delimiter=",", header="time_s,displacement_mm,lateral_mm", comments="")
    task = recorded_task(path, 1000.0)
    assert task.samples == 2990
    settings = dataclasses.replace(Bilateral(), feedback=Feedback(method="direct"))
    series = simulate(settings, seed=1, task=task)
    assert np.sqrt(np.mean((series.master_mm - task.path[:-1]) ** 2)) < 1.5
    assert series.tissue_force_n.max() > 0.5
    assert series.column(5)[-1] == pytest.approx(0.5 * 2.99, abs=0.01)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("time_s,force_N\n0,1\n1,2\n", "displacement_mm"),
        ("time_s,displacement_mm\n0,1\n", "two rows"),
        ("time_s,displacement_mm\n0,1\n0,2\n", "rise"),
        ("time_s,displacement_mm\n0,x\n", "cannot read"),
        ("time_s,displacement_mm\n0,1\n99999,2\n", "lasts"),
    ],
)
def test_a_motion_that_is_none_is_named(tmp_path: Path, text: str, word: str) -> None:
    path = tmp_path / "motion.csv"
    path.write_text(text)
    with pytest.raises(ScenarioError, match=word):
        recorded_task(path, 1000.0)
    with pytest.raises(ScenarioError, match="cannot read"):
        recorded_task(tmp_path / "none.csv", 1000.0)


def test_struct_size_is_what_the_page_says() -> None:
    page = (Path(__file__).parents[2] / "docs" / "teleoperation.md").read_text(encoding="utf-8")
    assert f"{SIZE} bytes" in page
    assert struct.calcsize("<4sBBHIQqqq4d3d5d4dd") == SIZE
