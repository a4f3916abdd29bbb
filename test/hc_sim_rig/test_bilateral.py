"""The bilateral teleoperation: passivity, bounds of the rendering, determinism, the equations.

Everything here is an invariant or a comparison with a plain reimplementation; how good each method
is, is measured by `hc bench teleoperation`.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from hc_sim_rig.bilateral import (
    Bilateral,
    BilateralSeries,
    Feedback,
    LumpyTissue,
    Network,
    Operator,
    rendering_kernel,
    simulate,
    waves_kernel,
)
from hc_sim_rig.bilateral import layout as at
from hc_sim_rig.bilateral.mediator import Mediator
from hc_sim_rig.bilateral.rendering_kernel import elastic_energy
from hc_sim_rig.bilateral.task import Span, Task, palpation_task, tremor
from hc_sim_rig.compilation import compiled
from hc_sim_rig.schema import ScenarioError

STEP = 0.001
# As plain functions: the closed loop compiles them into one kernel, these tests call each alone.
(
    master_wave,
    master_wave_force,
    slave_wave,
    slave_wave_force,
    slave_wave_velocity,
    wave_in,
    wave_out,
) = (
    function.py_func
    for function in (
        waves_kernel.master_wave,
        waves_kernel.master_wave_force,
        waves_kernel.slave_wave,
        waves_kernel.slave_wave_force,
        waves_kernel.slave_wave_velocity,
        waves_kernel.wave_in,
        waves_kernel.wave_out,
    )
)


@compiled
def render(
    position: float, velocity: float, packet: np.ndarray, constants: np.ndarray, memory: np.ndarray
) -> tuple[float, float]:
    """The renderer, which has no cache of its own."""
    return rendering_kernel.render(position, velocity, packet, constants, memory)


def short_task(seconds: float = 6.0) -> Task:
    """The palpation task's beginning: free motion, first contact, presses."""
    task = palpation_task(1000.0)
    count = round(seconds * 1000.0)
    span = Span(0.0, seconds)
    return dataclasses.replace(
        task, path=task.path[: count + 1], lateral=task.lateral[: count + 1], hold=span
    )


def run(
    method: str, round_trip_ms: float, seconds: float = 6.0, **parts: object
) -> BilateralSeries:
    network = parts.pop("network", Network(round_trip_ms=round_trip_ms))
    settings = Bilateral(network=network, feedback=Feedback(method=method), **parts)
    return simulate(settings, seed=3, task=short_task(seconds))


@pytest.mark.parametrize("method", at.METHODS)
def test_the_same_seed_gives_the_same_bytes_and_another_one_does_not(method: str) -> None:
    first, again = run(method, 100.0, 3.0), run(method, 100.0, 3.0)
    assert first.rows.tobytes() == again.rows.tobytes()
    assert first.lost == again.lost != (0, 0)
    settings = first.settings
    other = simulate(settings, seed=4, task=short_task(3.0))
    assert np.any(other.hand_force_n != first.hand_force_n)


def test_blocks_are_the_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    """A method without estimator gives the same numbers however the loop is cut."""
    from hc_sim_rig.bilateral import simulation

    whole = run("direct", 20.0, 2.0)
    cut = simulation.advance

    def in_pieces(first: int, count: int, *rest: object) -> None:
        for k in range(first, first + count, 7):
            cut(k, min(7, first + count - k), *rest)

    monkeypatch.setattr(simulation, "advance", in_pieces)
    assert run("direct", 20.0, 2.0).rows.tobytes() == whole.rows.tobytes()


@pytest.mark.parametrize(("delay", "seed"), [(0, 0), (17, 1), (150, 2), (499, 3)])
def test_waves_are_passive_for_any_constant_delay_whatever_the_ends_do(
    delay: int, seed: int
) -> None:
    """Random motions at both ends, lossless line: what goes in less what comes out is stored."""
    random = np.random.default_rng([seed, delay])
    impedance, count = 0.03, 1500
    velocity = np.cumsum(random.normal(size=count)) + 20.0 * random.normal(size=count)
    slave_motion = 10.0 * np.cumsum(random.normal(size=count))
    memory = np.zeros(at.MEMORY_SIZE)
    sent = np.zeros((2, count, 2))
    energy, command = 0.0, 0.0
    stored = []
    for k in range(count):
        late = k - 1 - delay
        incoming = [
            wave_out(side, *(sent[side, late] if late >= 0 else (0.0, 0.0)), 1, STEP, memory)
            for side in range(2)
        ]
        force = slave_wave_force(
            incoming[0], command - slave_motion[k], 0.0, 2.0, impedance, impedance
        )
        wanted = slave_wave_velocity(incoming[0], force, impedance)
        command += wanted * STEP
        at_hand = master_wave_force(velocity[k], incoming[1], impedance)
        wave_in(0, master_wave(velocity[k], incoming[1], impedance), STEP, memory)
        wave_in(1, slave_wave(incoming[0], force, impedance), STEP, memory)
        for side in range(2):
            sent[side, k] = (
                memory[at.MEMORY_WAVE_SENT + side],
                memory[at.MEMORY_WAVE_ENERGY_SENT + side],
            )
        energy += STEP * (at_hand * velocity[k] - force * wanted)
        stored.append(
            sum(
                memory[at.MEMORY_WAVE_ENERGY_SENT + side]
                - memory[at.MEMORY_WAVE_ENERGY_USED + side]
                for side in range(2)
            )
        )
        rounding = 1e-11 * memory[at.MEMORY_WAVE_ENERGY_SENT :][:2].sum() + 1e-9
        assert stored[-1] >= -rounding
        assert energy == pytest.approx(stored[-1], rel=0.0, abs=rounding)
    assert max(stored) > 1.0


@pytest.mark.parametrize(("round_trip", "loss"), [(0.0, 0.1), (100.0, 0.5), (1000.0, 0.1)])
def test_waves_stay_passive_with_jitter_and_loss(round_trip: float, loss: float) -> None:
    series = run("wave_variables", round_trip, network=Network(round_trip_ms=round_trip, loss=loss))
    for side in range(2):
        assert series.column(at.OUT_WAVE_STORED + side).min() >= -1e-9
    stored = series.column(at.OUT_WAVE_STORED) + series.column(at.OUT_WAVE_STORED + 1)
    np.testing.assert_allclose(series.column(at.OUT_WAVE_PORTS), stored, atol=1e-8)
    assert series.tissue_force_n.max() > 0.1


def test_what_was_lost_on_the_way_comes_later() -> None:
    """Integrals are sent, not waves: the tool ends where the hand led it, loss or none."""
    quiet = Operator(tremor_std_n=0.0)
    nothing = LumpyTissue(surface_mm=90.0)
    ends = []
    for loss in (0.0, 0.3):
        network = Network(round_trip_ms=20.0, loss=loss)
        series = run("wave_variables", 20.0, 2.0, network=network, operator=quiet, tissue=nothing)
        ends.append(series.slave_mm[-1] - series.master_mm[-1])
    assert abs(ends[1] - ends[0]) < 0.05


@pytest.mark.parametrize("round_trip", [0.0, 300.0])
def test_model_mediated_bounds_hold(round_trip: float) -> None:
    """Rate and energy of the updates, and the energy that the hand gets back."""
    series = run("model_mediated", round_trip, 6.0)
    feedback = series.settings.feedback
    change = np.abs(series.column(at.OUT_UPDATE_CHANGE))
    assert 0.0 < change.max() <= feedback.update_rate_n_per_s * STEP * (1.0 + 1e-12)
    tank = series.column(at.OUT_TANK)
    assert tank.min() > -1e-3
    assert tank.max() <= feedback.tank_mj
    # The hand's own account: its work on the renderer, which held each force for one sample.
    work = np.concatenate([[0.0], np.cumsum(series.hand_force_n[:-1] * np.diff(series.master_mm))])
    assert work.min() >= -feedback.tank_mj
    assert np.ptp(work) > 1.0


def test_no_force_in_free_motion_and_none_before_the_model() -> None:
    series = run("model_mediated", 300.0, 6.0)
    known = np.isfinite(series.model[:, 0])
    first = int(np.argmax(known))
    touched = int(np.argmax(series.tissue_force_n > 0.0))
    assert known[-1]
    assert first > touched + 100  # the way back takes 150 ms less its jitter
    assert np.all(series.hand_force_n[:first] == 0.0)
    # At first contact the surface begins under the hand, not where the hand would be thrown out.
    assert series.model[first, 4] >= series.master_mm[first] - 0.05
    assert abs(series.hand_force_n[first]) <= 0.02
    free = known & (series.master_mm < series.model[:, 4] - 0.05)
    assert free.sum() > 100
    assert np.all(series.hand_force_n[free] == 0.0)


def arrived(model: tuple[float, ...]) -> np.ndarray:
    packet = np.zeros(at.SENT_COLUMNS)
    packet[at.SENT_KNOWN] = 1.0
    packet[at.SENT_MODEL : at.SENT_MODEL + at.MODEL_SIZE] = model
    return packet


@pytest.mark.parametrize("seed", range(3))
def test_no_model_whatever_it_is_breaks_the_bounds(seed: int) -> None:
    """Wild models every few samples, a hand that moves at random: rate and energy hold."""
    random = np.random.default_rng(seed)
    settings = Bilateral()
    constants, feedback = settings.constants(), settings.feedback
    memory = np.zeros(at.MEMORY_SIZE)
    memory[at.MEMORY_TANK] = feedback.tank_mj
    position, velocity, work, worst, force = 0.0, 0.0, 0.0, 0.0, 0.0
    packet = np.zeros(at.SENT_COLUMNS)
    felt = 0.0
    for k in range(4000):
        if k % 5 == 0:
            stiffness = math.exp(random.uniform(math.log(1e-3), math.log(2.0)))
            packet = arrived(
                (
                    stiffness,
                    stiffness * random.uniform(0.0, 0.1),
                    random.uniform(0.6, 2.5),
                    random.uniform(0.3, 1.5),
                    random.uniform(-3.0, 3.0),
                )
            )
        velocity += STEP * (-60.0 * velocity - 400.0 * (position - 1.0)) + random.normal() * 8.0
        moved = velocity * STEP
        work += force * moved
        position += moved
        measured = velocity
        force, change = render(position, measured, packet, constants, memory)
        memory[at.MEMORY_MASTER_BEFORE] = position
        assert abs(change) <= feedback.update_rate_n_per_s * STEP * (1.0 + 1e-12)
        worst = min(worst, work)
        felt = max(felt, force)
        model = memory[at.MEMORY_MODEL : at.MEMORY_MODEL + at.MODEL_SIZE]
        energy = elastic_energy(position, model, constants)
        assert memory[at.MEMORY_ELASTIC] == pytest.approx(energy, abs=1e-9)
    assert felt > 0.1
    # The tank bounds it; one sample's rounding of a held force comes on top.
    assert worst >= -feedback.tank_mj - 0.05


def test_an_empty_tank_lets_no_energy_in_but_takes_it_back() -> None:
    constants = Bilateral().constants()
    memory = np.zeros(at.MEMORY_SIZE)
    soft, hard = (0.1, 0.0, 1.0, 1.0, 0.0), (0.4, 0.0, 1.0, 1.0, 0.0)
    memory[at.MEMORY_RENDERED] = 1.0
    memory[at.MEMORY_MODEL : at.MEMORY_MODEL + 5] = soft
    memory[at.MEMORY_MASTER_BEFORE] = 2.0
    memory[at.MEMORY_ELASTIC] = elastic_energy(2.0, np.array(soft), constants)
    memory[at.MEMORY_FORCE_BEFORE] = 0.2
    memory[at.MEMORY_TANK] = 0.0
    for _ in range(500):
        force, change = render(2.0, 0.0, arrived(hard), constants, memory)
        assert change == 0.0
    assert force == pytest.approx(0.2)
    for _ in range(500):
        force, change = render(2.0, 0.0, arrived((0.05, 0.0, 1.0, 1.0, 0.0)), constants, memory)
        assert change <= 0.0
    assert force == pytest.approx(0.1, rel=1e-3)
    assert memory[at.MEMORY_TANK] == pytest.approx(0.1, rel=1e-2)


def test_the_passivity_controller_damps_when_the_tank_is_overdrawn() -> None:
    constants = Bilateral().constants()
    memory = np.zeros(at.MEMORY_SIZE)
    memory[at.MEMORY_TANK] = -0.01
    for velocity in (5.0, -5.0):
        force, _ = render(0.0, velocity, np.zeros(at.SENT_COLUMNS), constants, memory)
        assert force * velocity > 0.0
        assert abs(force) <= constants.controller_damping * 5.0 + 1e-12


def test_without_operator_and_feedback_nothing_makes_energy() -> None:
    """The slave's command stands still; the tissue gets no more than the slave's spring had."""
    still = dataclasses.replace(short_task(2.0), path=np.full(2001, -5.0), lateral=np.zeros(2001))
    for method in at.METHODS:
        settings = Bilateral(feedback=Feedback(method=method), operator=Operator(tremor_std_n=0.0))
        series = simulate(settings, seed=0, task=still)
        assert np.abs(series.master_mm + 5.0).max() < 0.05
        assert series.tissue_force_n.max() == 0.0


def test_arm_and_device_are_the_second_order_system_that_is_written_down() -> None:
    """No feedback in free motion (direct, nothing to touch): hand against a closed form."""
    operator = Operator(tremor_std_n=0.0, correction_rate=0.0)
    tissue = LumpyTissue(surface_mm=90.0)
    task = dataclasses.replace(
        short_task(2.0), path=np.r_[0.0, np.full(2000, 3.0)], lateral=np.zeros(2001)
    )
    settings = Bilateral(operator=operator, tissue=tissue, feedback=Feedback(method="direct"))
    settings = dataclasses.replace(
        settings, slave=dataclasses.replace(settings.slave, force_noise_std_n=0.0)
    )
    series = simulate(settings, seed=0, task=task)
    # after the step the arm is a free oscillator about 3 mm
    mass, damping, stiffness = 0.5e-3, 0.012, 0.6
    x, v = series.master_mm[1], series.column(at.OUT_MASTER_VELOCITY)[1]
    time = np.arange(1999) * STEP
    decay = damping / (2.0 * mass)
    turn = math.sqrt(stiffness / mass - decay**2)
    swing = (v + decay * (x - 3.0)) / turn
    expected = 3.0 + np.exp(-decay * time) * (
        (x - 3.0) * np.cos(turn * time) + swing * np.sin(turn * time)
    )
    np.testing.assert_allclose(series.master_mm[1:], expected, atol=2e-5)


def test_the_reaction_comes_late() -> None:
    """The voluntary correction sees the hand's error of reaction_s ago."""
    tissue = LumpyTissue(surface_mm=90.0)
    base = Operator(tremor_std_n=0.0, correction_rate=0.0)
    task = dataclasses.replace(
        short_task(1.0), path=np.r_[0.0, np.full(1000, 3.0)], lateral=np.zeros(1001)
    )
    paths = [
        simulate(
            Bilateral(
                operator=dataclasses.replace(base, correction_rate=rate),
                tissue=tissue,
                feedback=Feedback(method="direct"),
            ),
            seed=0,
            task=task,
        ).master_mm
        for rate in (0.0, 2.0)
    ]
    parted = int(np.argmax(paths[0] != paths[1]))
    assert 200 <= parted <= 203


def test_tremor_has_its_strength_and_its_band() -> None:
    force = tremor(60_000, 1000.0, 0.05, 8.0, 12.0, seed=5)
    assert force.std() == pytest.approx(0.05, rel=0.1)
    power = np.abs(np.fft.rfft(force)) ** 2
    frequency = np.fft.rfftfreq(len(force), STEP)
    inside = (frequency >= 7.9) & (frequency <= 12.1)
    assert power[inside].sum() > 0.99 * power.sum()


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Feedback(method="telepathy"), "method is 'telepathy'.*model_mediated"),
        (lambda: Network(round_trip_ms=-1.0), "round_trip_ms is -1"),
        (lambda: Network(round_trip_ms=1e5), "round_trip_ms is 100000"),
        (lambda: Operator(mass_kg=0.0), "mass_kg is 0"),
        (lambda: simulate(Bilateral(feedback=Feedback(filter="oracle"))), "filter is 'oracle'"),
        (lambda: simulate(Bilateral(), seed=-1), "seed is -1"),
    ],
)
def test_what_cannot_be_is_named_in_one_line(make: object, says: str) -> None:
    with pytest.raises(ScenarioError, match=says) as caught:
        make()  # type: ignore[operator]
    assert "\n" not in str(caught.value)


def test_the_mediator_trusts_no_estimate_that_is_unsure() -> None:
    """Before contact no model; at contact a soft one; then the estimator's, near the truth."""
    random = np.random.default_rng(0)
    time = np.arange(6000) * STEP
    depth = np.where(time < 1.0, -2.0, 2.0 - 4.0 * np.cos(2.0 * np.pi * 0.5 * (time - 1.0)))
    speed = np.gradient(depth, STEP)
    inside = np.maximum(depth, 0.0)
    force = np.maximum(inside**1.6 * (0.25 + 0.006 * np.sign(speed) * np.abs(speed) ** 0.9), 0.0)
    force = force + random.normal(size=len(time)) * 0.01
    position = depth + 7.0 + random.normal(size=len(time)) * 0.002
    mediator = Mediator("ukf", 1000.0)
    known, first = [], None
    for k in range(0, len(time), 10):
        mediator.take(time[k : k + 10], position[k : k + 10], force[k : k + 10])
        known.append(mediator.model[0])
        if first is None and mediator.model[0] == 1.0:
            first = mediator.model.copy()
    touch = int(np.argmax(depth > 0.0)) // 10
    assert not any(known[:touch])
    assert first is not None
    np.testing.assert_allclose(first[1:5], (0.1, 0.0, 1.0, 1.0))
    assert first[5] == pytest.approx(7.5, abs=0.5)
    stiffness, _, exponent, _, surface = mediator.model[1:]
    assert surface == pytest.approx(7.0, abs=0.1)
    assert stiffness * 3.0**exponent == pytest.approx(0.25 * 3.0**1.6, rel=0.1)
    assert mediator.trusted > 100
