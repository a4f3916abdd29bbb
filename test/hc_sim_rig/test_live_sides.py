"""Both live sides of a teleoperation, in one process with its own clock; recorded motions."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from hc_sim_rig.bilateral import Bilateral, Feedback, SlaveArm, simulate
from hc_sim_rig.bilateral.datagrams import MASTER, SLAVE, Datagram
from hc_sim_rig.bilateral.model_source import ModelSource, SlaveModel
from hc_sim_rig.bilateral.sides import MasterSide, SlaveSide
from hc_sim_rig.bilateral.simulated_hand import SimulatedHand
from hc_sim_rig.bilateral.task import palpation_task, recorded_task
from hc_sim_rig.bilateral.udp_link import Added, UdpLink
from hc_sim_rig.schema import ScenarioError

MS = 1_000_000
HERE = "127.0.0.1"
TISSUE = (0.25, 0.006, 1.6, 0.9, 0.0)


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
    known = SlaveModel(TISSUE, (0.01,) * 5, 0.05, True)
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
    stiff = (20.0, 0.0, 1.0, 1.0, 0.0)
    links[1].send(Datagram(SLAVE, 7, 5, 3, 4, 1.0, -2.0, 3.0, 0.5, stiff, (0.1,) * 5, 0.2, True), 0)
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
    source.take(parameters, good, 0.1, 0.02, 3.0, 0.01, 7.0)
    assert source.current.sure
    assert source.current.deviations == pytest.approx((1e-3,) * 4 + (0.02,))
    assert source.current.model == (*TISSUE[:4], 0.1)
    # Nobody knows: the last one stays.
    source.take(2.0 * parameters, np.eye(4), 0.1, 0.02, 3.0, 0.01, 7.0)
    assert not source.current.sure
    assert source.current.model == (*TISSUE[:4], 0.1)
    source.take(parameters * np.nan, good, 0.1, 0.02, 3.0, 0.01, 7.0)
    assert not source.current.sure


def test_of_an_estimate_that_grows_old_nobody_is_sure(links: tuple[UdpLink, UdpLink]) -> None:
    """An estimator that died left the slave stiff, and everybody sure, for good."""
    source, hard = ModelSource(), np.array((1.0, *TISSUE[1:4]))
    assert source.age_s(1.0) == math.inf
    arm = SlaveArm(impedance="adaptive")
    slave = SlaveSide(Bilateral(slave=arm), links[1], -1.0, 1)
    for k in range(4000):
        if k < 2000:
            source.take(hard, np.diag([1e-6] * 4), 0.1, math.nan, 3.0, 0.01, k * 1e-3)
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
