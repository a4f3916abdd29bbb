"""What docs/teleoperation.md guarantees of the rendered force, as properties.

A story is what may happen to the hand's side: a hand that presses, leaves and comes back; models
that arrive late, wrong, in bursts of loss, or of an estimator that began anew; a device that falls
silent. Hypothesis writes the stories; the bounds must hold in each.
"""

from __future__ import annotations

import dataclasses
import math
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from hc_sim_rig.bilateral import (
    Bilateral,
    Feedback,
    Network,
    SlaveArm,
    layout,
    simulate,
    waves_kernel,
)
from hc_sim_rig.bilateral.datagrams import MASTER, SLAVE, Datagram
from hc_sim_rig.bilateral.device_poses import DevicePoses
from hc_sim_rig.bilateral.model_source import SlaveModel
from hc_sim_rig.bilateral.sides import MasterSide, SlaveSide
from hc_sim_rig.bilateral.task import Span, palpation_task

MS = 1_000_000
STEP = 0.001
RATE_N = Feedback().update_rate_n_per_s * STEP
TANK_MJ = Feedback().tank_mj
HELD_FORCE_MJ = 0.05
"""What a force that is held for a sample may make, at the speeds of a hand."""


class Scene(NamedTuple):
    """A part of a story."""

    samples: int
    towards_mm: float
    """Where the hand goes, smoothly; it arrives at the end."""
    swing_mm: float
    swing_hz: float
    model: tuple[float, ...] | None
    """What arrives from now on: K, B, n, p, surface; None: nothing but the old."""
    seen: bool
    """Whether the device says where the hand is."""


# What the mediator lets through: LOWEST to HIGHEST of hc_sim_rig.bilateral.mediator.
MODELS = st.tuples(
    st.floats(-4.0, 1.3).map(lambda x: 10.0**x),
    st.floats(0.0, 5.0),
    st.floats(0.5, 4.0),
    st.floats(0.2, 2.0),
    st.floats(-6.0, 6.0),
)
SCENES = st.builds(
    Scene,
    samples=st.integers(40, 250),
    towards_mm=st.floats(-4.0, 4.0),
    swing_mm=st.floats(0.0, 0.5),
    swing_hz=st.floats(1.0, 12.0),
    model=st.none() | MODELS,
    seen=st.booleans() | st.just(True),
)
STORIES = st.lists(SCENES, min_size=1, max_size=8)
TISSUE = (0.25, 0.006, 1.6, 0.9, 0.0)
STIFF = (5.0, 0.1, 1.5, 0.5, -1.0)
SILENT_AND_BACK_IN_DEPTH = [
    Scene(100, -1.0, 0.0, 1.0, TISSUE, True),
    Scene(100, 3.0, 0.0, 1.0, None, False),
    Scene(200, 3.0, 0.0, 1.0, None, True),
    Scene(200, -1.0, 0.0, 1.0, None, True),
]
ANOTHER_ESTIMATOR_IN_DEPTH = [
    Scene(200, 3.0, 0.0, 1.0, TISSUE, True),
    Scene(100, 3.0, 0.0, 1.0, STIFF, True),
    Scene(200, -2.0, 0.0, 1.0, (0.1, 0.0, 1.0, 1.0, 1.0), True),
]


class Played(NamedTuple):
    """What came of a story, a row a sample; silent ones have force zero."""

    hand_mm: np.ndarray
    force_n: np.ndarray
    update_n: np.ndarray
    tank_mj: np.ndarray
    surface_mm: np.ndarray
    spring_mj: np.ndarray


class StandInLink:
    """Gives a side what the story says has come."""

    def __init__(self) -> None:
        """Nothing has come."""
        self.newest: Datagram | None = None
        self.restarts = 0
        self.silent = False
        self.playout = SimpleNamespace(lead=lambda *_: 1)

    def receive(self, _now_ns: int) -> None:
        """What has come is in `newest` already."""

    def silence_s(self, _now_ns: int) -> float:
        """For how long nothing has come."""
        return math.inf if self.silent else 0.0

    def send(self, datagram: Datagram, _now_ns: int) -> None:
        """What a side sends must be fit to be sent."""
        assert math.isfinite(datagram.force_n)


def play(story: list[Scene], tank_mj: float = TANK_MJ, still: bool = False) -> Played:
    """Let the hand's side live through a story; `still`: the hand only moves where nobody looks."""
    link = StandInLink()
    side = MasterSide(Bilateral(feedback=Feedback(tank_mj=tank_mj)), link)  # type: ignore[arg-type]
    rows, hand, k = [], -1.0, 0
    for scene in story:
        if scene.model is not None:
            link.newest = Datagram(SLAVE, k, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, scene.model)
        begin = hand
        for i in range(scene.samples):
            share = 0.5 - 0.5 * math.cos(math.pi * (i + 1) / scene.samples)
            swing = scene.swing_mm * math.sin(2.0 * math.pi * scene.swing_hz * STEP * i)
            if not (still and scene.seen):
                hand = begin + share * (scene.towards_mm - begin) + swing
            if scene.seen:
                felt = side.step(k * MS, hand, 0.0)
                spring = side._memory[layout.MEMORY_ELASTIC]
                rows.append(
                    (hand, felt.force_n, felt.update_n, felt.tank_mj, felt.model[4], spring)
                )
            else:
                side.rest(k * MS)
                rows.append((hand, 0.0, 0.0, rows[-1][3] if rows else tank_mj, math.nan, 0.0))
            k += 1
    return Played(*np.array(rows).T)


def work_mj(played: Played) -> np.ndarray:
    """What the hand has put in so far [mJ]; a force is held until the next sample."""
    return np.r_[0.0, np.cumsum(played.force_n[:-1] * np.diff(played.hand_mm))]


@settings(max_examples=60)
@given(STORIES)
@example(SILENT_AND_BACK_IN_DEPTH)
@example(ANOTHER_ESTIMATOR_IN_DEPTH)
def test_no_update_changes_the_force_by_more_than_the_rate(story: list[Scene]) -> None:
    assert np.abs(play(story).update_n).max() <= RATE_N * (1.0 + 1e-9)


@settings(max_examples=60)
@given(STORIES)
@example(SILENT_AND_BACK_IN_DEPTH)
def test_at_a_hand_that_rests_no_force_jumps(story: list[Scene]) -> None:
    """First contact, losses, another estimator, a device that comes back where it was not."""
    played = play(story, still=True)
    seen = np.repeat([scene.seen for scene in story], [scene.samples for scene in story])
    both = seen[1:] & seen[:-1] & (np.abs(np.diff(played.hand_mm)) == 0.0)
    assert np.all(np.abs(np.diff(played.force_n))[both] <= RATE_N * (1.0 + 1e-9))
    back = seen[1:] & ~seen[:-1]
    assert np.all(np.abs(played.force_n[1:][back]) <= RATE_N * (1.0 + 1e-9))


@settings(max_examples=60)
@given(STORIES, st.sampled_from([0.0, 0.5, TANK_MJ]))
@example(SILENT_AND_BACK_IN_DEPTH, TANK_MJ)
@example(ANOTHER_ESTIMATOR_IN_DEPTH, TANK_MJ)
def test_the_hand_gets_back_what_it_put_in_and_the_tank(story: list[Scene], tank: float) -> None:
    """The account is exact at every sample, and what holding a force overdraws is little."""
    played = play(story, tank)
    work, held = work_mj(played), played.spring_mj + played.tank_mj
    assert np.all(work + tank >= held - 1e-6)
    assert work.min() >= -tank - HELD_FORCE_MJ


@settings(max_examples=60)
@given(STORIES)
def test_no_force_where_the_model_is_not_touched(story: list[Scene]) -> None:
    played = play(story)
    out = ~(played.hand_mm > played.surface_mm) & (played.tank_mj >= 0.0)
    assert np.all(played.force_n[out] == 0.0)


@given(
    st.lists(
        st.floats(-5.0, 5.0)
        | st.sampled_from([math.nan, math.inf, -math.inf, 1e300, 1e5, -1e5, 3.0, 300.0]),
        max_size=60,
    )
)
@example([3.0, math.nan, 3.0, 300.0, 3.0])
def test_no_pose_that_is_refused_makes_a_force(places: list[float]) -> None:
    """Whatever a device says: none at that sample, and then as at first contact."""
    link = StandInLink()
    link.newest = Datagram(SLAVE, 0, 0, 0, 0, 0.0, 0.0, 0.0, 0.0, STIFF)
    side, poses = MasterSide(Bilateral(), link), DevicePoses(1.0)  # type: ignore[arg-type]
    begun = False
    for k, place in enumerate([-2.0, 0.0, *places]):
        refused = sum(poses.refused.values())
        poses.take(place, 0.0, 1e-3 * k)
        where = poses.where(1e-3 * k)
        if sum(poses.refused.values()) > refused:
            assert where is None
        if where is None:
            side.rest(k)
            begun = False
            continue
        force = side.step(k, *where).force_n
        assert 0.0 <= abs(force) <= (8.0 if begun else RATE_N * (1.0 + 1e-9))
        begun = True


@settings(max_examples=40)
@given(
    st.lists(st.tuples(st.floats(-200.0, 200.0), st.booleans(), st.integers(0, 40)), max_size=300),
    st.integers(1, 30),
)
def test_no_network_makes_energy_out_of_waves(
    sent: list[tuple[float, bool, int]], lead: int
) -> None:
    """Packets lost in any pattern, late by any time, overtaken: never more out than went in."""
    memory = np.zeros(layout.MEMORY_SIZE)
    arrivals: dict[int, tuple[int, float, float]] = {}
    newest = (-1, 0.0, 0.0)
    for k in range(len(sent) + 60):
        if k < len(sent):
            wave, lost, late = sent[k]
            waves_kernel.wave_in.py_func(0, wave, STEP, memory)
            packet = (
                k,
                float(memory[layout.MEMORY_WAVE_SENT]),
                float(memory[layout.MEMORY_WAVE_ENERGY_SENT]),
            )
            if not lost:
                arrivals[k + late] = max(arrivals.get(k + late, packet), packet)
        newest = max(newest, arrivals.get(k, newest))
        waves_kernel.wave_out.py_func(0, newest[1], newest[2], lead, STEP, memory)
        out, into = memory[layout.MEMORY_WAVE_ENERGY_USED], memory[layout.MEMORY_WAVE_ENERGY_SENT]
        assert out <= into * (1.0 + 1e-12) + 1e-12


class Command(NamedTuple):
    """A part of the tool's story."""

    samples: int
    heard: bool
    """Whether the master is heard."""
    towards_mm: float
    model: tuple[float, ...] | None
    """None: an estimator that has just begun."""
    sure: bool


COMMANDS = st.builds(
    Command,
    samples=st.integers(20, 400),
    heard=st.booleans() | st.just(True),
    towards_mm=st.floats(-3.0, 6.0),
    model=st.none() | MODELS,
    sure=st.booleans() | st.just(True),
)


@settings(max_examples=12)
@given(st.lists(COMMANDS, min_size=1, max_size=6))
@example(
    [
        Command(400, True, 4.0, STIFF, True),
        Command(300, True, 4.0, None, False),  # the estimator began anew
        Command(300, False, 0.0, TISSUE, True),
        Command(300, True, -3.0, TISSUE, True),
    ]
)
def test_the_adapted_controller_keeps_its_bounds_in_any_story(story: list[Command]) -> None:
    link, arm = StandInLink(), SlaveArm(impedance="adaptive")
    side = SlaveSide(Bilateral(slave=arm), link, -3.0, 1)  # type: ignore[arg-type]
    rows, command, k = [], -3.0, 0
    for part in story:
        known = SlaveModel(part.model, sure=part.sure) if part.model else SlaveModel()
        step = (part.towards_mm - command) / part.samples
        for _ in range(part.samples):
            if part.heard:
                command += step
                link.newest = Datagram(MASTER, k, k * MS, 0, 0, command, step / STEP, 0.0, 0.0)
            link.silent = not part.heard
            read = side.step(k * MS, known)
            rows.append((read.stiffness, read.command_mm - read.position_mm, known.sure))
            k += 1
    stiffness, stretch, sure = np.array(rows).T
    assert np.all(
        (stiffness >= arm.stiffness_low - 1e-9) & (stiffness <= arm.stiffness_high + 1e-9)
    )
    change = np.diff(stiffness)
    assert np.all(np.abs(change) <= arm.stiffness_rate * STEP * (1.0 + 1e-9))
    in_force = np.abs(change * stretch[1:])
    assert np.all(in_force <= arm.stiffness_force_rate_n_s * STEP * (1.0 + 1e-9))
    assert np.all(change[sure[1:] == 0.0] <= 1e-12)


@settings(max_examples=3)
@given(
    st.floats(0.0, 1000.0),
    st.floats(0.0, 0.9),
    st.floats(0.0, 0.1),
    st.sampled_from(["self_tuning_ukf", "ekf", "rls"]),
    st.integers(0, 1000),
)
@example(300.0, 0.9, 0.1, "self_tuning_ukf", 1)
def test_the_whole_loop_keeps_the_bounds_in_any_network(
    round_trip_ms: float, loss: float, jitter: float, name: str, seed: int
) -> None:
    """First contact and separation in closed loop, with an arm, an estimator and the channel."""
    feedback = Feedback(filter=name)
    network = Network(round_trip_ms=round_trip_ms, loss=loss, jitter_share=jitter)
    task = palpation_task(1000.0)
    short = dataclasses.replace(
        task, path=task.path[:5001], lateral=task.lateral[:5001], hold=Span(0.0, 5.0)
    )
    series = simulate(Bilateral(network=network, feedback=feedback), seed=seed, task=short)
    assert np.abs(series.column(layout.OUT_UPDATE_CHANGE)).max() <= RATE_N * (1.0 + 1e-9)
    work = np.r_[0.0, np.cumsum(series.hand_force_n[:-1] * np.diff(series.master_mm))]
    assert work.min() >= -TANK_MJ - HELD_FORCE_MJ
    assert series.tissue_force_n.max() > 0.5
