"""Position-position and wave variables as live sides: as the simulation, passive, aligned."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from hc_sim_rig.bilateral import Bilateral, Feedback, Network, layout, simulate
from hc_sim_rig.bilateral.datagrams import MASTER, SLAVE
from hc_sim_rig.bilateral.model_source import SlaveModel
from hc_sim_rig.bilateral.playout import PLAYOUT_SAMPLES, Playout
from hc_sim_rig.bilateral.sides import MasterSide, SlaveSide
from hc_sim_rig.bilateral.simulated_hand import SimulatedHand
from hc_sim_rig.bilateral.task import palpation_task
from hc_sim_rig.bilateral.udp_link import Added, UdpLink

MS = 1_000_000
HERE = "127.0.0.1"
WAVES = layout.METHODS.index("wave_variables")
AHEAD_NS = 40_000 * MS
"""The slave's clock is so far ahead."""


class Pair:
    """Two sides and their link, in one process with clocks of its own."""

    def __init__(self, settings: Bilateral, added: Added, start_mm: float = -5.0) -> None:
        first = UdpLink(MASTER, HERE, 0, HERE, 1, added, 1)
        port = first.port
        second = UdpLink(SLAVE, HERE, 0, HERE, port, added, 2)
        first.close()
        first = UdpLink(MASTER, HERE, port, HERE, second.port, added, 1)
        self.links = (first, second)
        self.hand = SimulatedHand(settings, palpation_task(1000.0), 1)
        # The slave is told nothing of the method: the master's datagrams say it.
        self.master = MasterSide(settings, first)
        self.slave = SlaveSide(Bilateral(), second, start_mm, 1)
        self.rows: list[tuple[float, ...]] = []
        self.k = 0

    def run(self, seconds: float) -> np.ndarray:
        """Go on; returns all so far: hand, its force, tool, true force, energy there and back."""
        for _ in range(round(seconds * 1000)):
            now = 10**15 + self.k * MS
            felt = self.master.step(now, self.hand.reading_mm(), self.hand.lateral_mm)
            read = self.slave.step(now + AHEAD_NS, SlaveModel())
            self.hand.move(felt.force_n)
            sent, used = layout.MEMORY_WAVE_ENERGY_SENT, layout.MEMORY_WAVE_ENERGY_USED
            there, back = layout.FORWARD, layout.BACKWARD
            at_hand, at_tool = self.master._memory, self.slave._memory
            self.rows.append(
                (
                    felt.position_mm,
                    felt.force_n,
                    read.true_position_mm,
                    read.true_force_n,
                    at_hand[sent + there] - at_tool[used + there],
                    at_tool[sent + back] - at_hand[used + back],
                )
            )
            self.k += 1
        return np.array(self.rows)

    def close(self) -> None:
        for link in self.links:
            link.close()


@pytest.fixture
def pair(request: pytest.FixtureRequest) -> Iterator[Pair]:
    method, round_trip_ms, start_mm = request.param
    delay = 0.5e-3 * round_trip_ms
    added = Added(delay, 0.1 * delay, 0.1 if delay else 0.0)
    made = Pair(Bilateral(feedback=Feedback(method=method)), added, start_mm)
    yield made
    made.close()


@pytest.mark.parametrize(
    ("pair", "round_trip_ms"),
    [
        (("position_position", 20.0, -5.0), 20.0),
        pytest.param(("wave_variables", 20.0, -5.0), 20.0, marks=pytest.mark.slow),
        (("wave_variables", 300.0, -5.0), 300.0),
    ],
    indirect=["pair"],
)
def test_live_it_is_the_simulation(pair: Pair, round_trip_ms: float) -> None:
    """With delay, jitter and loss, and 40 s between the clocks: as offline, but for the dice."""
    method = layout.METHODS[pair.master._method]
    offline = simulate(
        Bilateral(network=Network(round_trip_ms=round_trip_ms), feedback=Feedback(method=method)),
        seed=1,
    )
    hand, force, tool, true, _, _ = pair.run(7.0).T
    count = len(hand)
    assert pair.slave.method == method
    assert pair.slave.aligned
    assert true.max() == pytest.approx(offline.tissue_force_n[:count].max(), rel=0.15)
    for live, column, most in (
        (hand, offline.master_mm, 0.2),
        (tool, offline.slave_mm, 0.2),
        (force, offline.hand_force_n, 0.1),
    ):
        assert np.sqrt(np.mean((live - column[:count]) ** 2)) < most


@pytest.mark.parametrize("pair", [("wave_variables", 100.0, -5.0)], indirect=True)
def test_no_energy_comes_of_the_way(pair: Pair) -> None:
    """What comes out of the waves has gone in, through jitter, loss, an outage and a restart."""
    run = pair.run(3.0)
    pair.links[1]._added = pair.links[0]._added._replace(loss=1.0)
    pair.run(1.5)
    pair.links[1]._added = pair.links[0]._added
    pair.run(1.5)
    pair.links[0].sent, pair.links[0]._life = (
        0,
        pair.links[0]._life ^ 1,
    )  # the master, as a new process: its integrals begin anew
    pair.master._memory[layout.MEMORY_WAVE_SENT] = 0.0
    pair.master._memory[layout.MEMORY_WAVE_ENERGY_SENT] = 0.0
    run = pair.run(3.0)
    assert pair.links[1].restarts == 1
    assert run[:6000, 4].min() >= -1e-9
    assert run[:6000, 5].min() >= -1e-9
    assert run[6500:, 4].min() >= -1e-9
    hand, tool = run[-500:, 0], run[-500:, 2]
    assert np.abs(hand - tool).max() < 2.0  # it is led again
    assert np.abs(run[:, 1]).max() < 8.0


@pytest.mark.parametrize("pair", [("wave_variables", 20.0, 3.0)], indirect=True)
def test_the_tool_goes_to_the_hand_before_waves_lead_it(pair: Pair) -> None:
    """It begins 8 mm off: at 500 mm/s there, then led; the place stays the hand's."""
    run = pair.run(0.2)
    assert pair.slave.aligned
    assert np.abs(np.diff(run[:, 2])).max() < 1.2
    run = pair.run(0.8)
    assert abs(run[-1, 0] - run[-1, 2]) < 0.5


@pytest.mark.parametrize("pair", [("wave_variables", 0.0, -5.0)], indirect=True)
def test_the_tool_stays_when_no_wave_comes(pair: Pair) -> None:
    pair.run(1.5)
    places = []
    for k in range(pair.k, pair.k + 1500):
        now = 10**15 + k * MS + AHEAD_NS
        places.append(pair.slave.step(now, SlaveModel()).true_position_mm)
    assert not pair.slave.aligned
    assert abs(places[-1] - places[700]) < 0.05


def test_a_change_of_method_is_followed() -> None:
    """The hand's side was begun anew with another method: the slave does as it says."""
    pair = Pair(Bilateral(feedback=Feedback(method="position_position")), Added())
    try:
        pair.run(0.3)
        assert pair.slave.method == "position_position"
        pair.master = MasterSide(
            Bilateral(feedback=Feedback(method="wave_variables", wave_impedance=0.05)),
            pair.links[0],
        )
        pair.run(0.3)
        assert pair.slave.method == "wave_variables"
        assert pair.slave._constants.wave_impedance == 0.05
        assert pair.slave.aligned
    finally:
        pair.close()


def test_a_turn_comes_after_nearly_all_datagrams_whatever_the_clocks_say() -> None:
    """Mean and three deviations of the way, as it was measured, and nine samples."""
    dice = np.random.default_rng(1)
    playout = Playout()
    for k in range(4000):
        sent = k * MS
        playout.add(sent, sent + AHEAD_NS + round(50 * MS + 5 * MS * dice.standard_normal()))
    late = playout.lead(4000 * MS, 4000 * MS + AHEAD_NS, MS)
    assert late == pytest.approx(50 + 3 * 5 + PLAYOUT_SAMPLES, abs=1.5)
    playout.forget()
    playout.add(0, 7 * MS)
    assert playout.lead(0, 7 * MS, MS) == PLAYOUT_SAMPLES
