"""A tool that turns, a surface that moves: what was read when, however late and busy it all is."""

import math
import random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from hc_estimator.stream.contact_frame import ContactFrame, Payload, unit_quaternion, unit_vector
from hc_estimator.stream.contact_reading import ContactReading
from hc_estimator.stream.merger import LONGEST_QUEUE, Around, Merger, Reading
from hc_estimator.stream.poses import (
    SurfacePose,
    ToolPose,
    attitude_between,
    pose_at,
    surface_between,
)

MS = 1_000_000
UP = (0.0, 0.0, 1.0)
GRAVITY = np.array([0.0, 0.0, -9.81])
START = Rotation.from_euler("xyz", [170.0, 10.0, 30.0], degrees=True)
MOUNTING = Rotation.from_euler("z", 45.0, degrees=True)
AXIS = np.array(unit_vector((1.0, 2.0, -0.5)))
BIAS = np.array([0.3, -1.1, 4.2])
TIP = np.array([0.0, 0.0, 0.12])
NORMAL = np.array(unit_vector((0.2, -0.1, 1.0)))
POINT = np.array([0.4, 0.1, 0.2])
FRAME = ContactFrame(
    point=tuple(POINT),
    normal=tuple(NORMAL),
    tip=tuple(TIP),
    mounting=tuple(MOUNTING.as_quat()),
    payload=Payload(0.7, (0.0, 0.0, 0.0), tuple(BIAS)),
)


class Turning:
    """A tool that turns at a rate while it presses; times in ms."""

    def __init__(self, rate=0.5, breath_m=0.0):
        self.rate, self.breath_m = rate, breath_m

    def attitude(self, ms):
        return Rotation.from_rotvec(self.rate * 1e-3 * ms * AXIS) * START

    def lifted(self, ms):
        """How far the surface is along its normal [m]; straight between its poses at 30 Hz."""
        return self.breath_m * ms

    def push(self, ms):
        return 2.0 + math.sin(0.01 * ms)

    def depth_mm(self, ms):
        return 3.0 + 2.0 * math.sin(0.004 * ms)

    def pose(self, ms):
        turned = self.attitude(ms)
        tip = POINT + (self.lifted(ms) - 1e-3 * self.depth_mm(ms)) * NORMAL
        return ToolPose(tuple(tip - turned.apply(TIP)), unit_quaternion(turned.as_quat()))

    def wrench(self, ms):
        sensor = self.attitude(ms) * MOUNTING
        return tuple(sensor.inv().apply(self.push(ms) * NORMAL + 0.7 * GRAVITY) + BIAS)

    def surface(self, ms):
        return SurfacePose(tuple(POINT + self.lifted(ms) * NORMAL), tuple(NORMAL))


class Bench:
    """A merger and a reader; what comes is handed over in any order, as to a busy program."""

    def __init__(self, moves=False, wait=50, window=0, gap=100, silence=500):
        self.merger = Merger(
            maximum_wait_ns=wait * MS,
            reorder_window_ns=window * MS,
            maximum_gap_ns=gap * MS,
            with_surface=moves,
        )
        self.merger.surface_silence_ns = silence * MS
        self.reader = ContactReading(FRAME, moves=moves)
        self.read, self.released = [], []

    def feed(self, events, order=lambda event: event[0]):
        """Hand over (arrival, stream, stamp, value), in ms; returns stamps, depths and forces."""
        todo = sorted(events, key=order)
        waiting, earliest = [], None
        for arrival, *_ in reversed(todo):
            waiting.append(earliest)
            earliest = min(round(arrival * MS), earliest or 2**63)
        for (arrival, stream, stamp, value), waits in zip(todo, reversed(waiting), strict=True):
            add = getattr(self.merger, f"add_{stream}")
            self._take(add(round(stamp * MS), value, round(arrival * MS), waits), arrival)
        return self.read

    def _take(self, samples, now):
        for sample in samples:
            along = self.reader.read(sample)
            self.released.append((sample.stamp_ns / MS, now))
            if along is not None:
                self.read.append((sample.stamp_ns / MS, along.depth_mm, along.force_n))


def events_of(tool, until=1500, delay=20.0, jitter=0.0, surface_delay=None):
    """A wrench at 500 Hz, a pose at 125 Hz that is late, a surface at 30 Hz if it has a delay."""
    generator = random.Random(3)
    events = [(t + 0.2, "force", t, tool.wrench(t)) for t in np.arange(0.0, until, 2.0)]
    for t in np.arange(0.7, until, 8.0):
        late = delay + jitter * generator.random()
        events.append((t + late, "displacement", t, tool.pose(t)))
    if surface_delay is not None:
        for t in np.arange(0.3, until, 33.0):
            events.append((t + surface_delay, "surface", t, tool.surface(t)))
    return events


def errors(tool, read):
    """Largest errors of depth [mm] and force [N]."""
    depth = [abs(d - tool.depth_mm(t)) for t, d, _ in read if not math.isnan(d)]
    force = [abs(f - tool.push(t)) for t, _, f in read if not math.isnan(f)]
    return max(depth), max(force)


def stalled(events, begin, end):
    """Nothing came for a while, and then all of it, in its order, within a tenth of a ms."""
    return [(end - 1e-3 * (end - e[0]) if begin < e[0] < end else e[0], *e[1:]) for e in events]


@pytest.mark.parametrize(
    ("delay", "jitter", "stall"), [(0.5, 0.0, 0), (20.0, 0.0, 0), (20.0, 7.9, 0), (20.0, 5.0, 90)]
)
def test_a_wrench_is_turned_by_the_attitude_at_its_stamp(delay, jitter, stall):
    """The newest attitude, 24 ms old, was wrong by 18 mN at 0.5 rad/s."""
    tool, bench = Turning(), Bench()
    events = stalled(events_of(tool, delay=delay, jitter=jitter), 500, 500 + stall)
    read = bench.feed(events)
    assert len(read) > 900
    assert max(errors(tool, read)) < 1e-9
    assert bench.reader.without_attitude == 0
    assert bench.merger.counters.late == 0

    newest = ToolPose((0.0, 0.0, 0.0), tool.pose(1000 - delay - 4).attitude)
    wrong = FRAME.along_normal(FRAME.contact_force(tool.wrench(1000), newest.attitude))
    assert delay < 1.0 or abs(wrong - tool.push(1000)) > 0.015


def test_what_is_read_does_not_depend_on_how_far_a_busy_program_has_got():
    tool = Turning(breath_m=1e-5)
    events = stalled(events_of(tool, 700, jitter=3.0, surface_delay=40.0), 300, 380)
    results = []
    for order in (
        lambda e: e[0],
        lambda e: (e[1], e[0]),
        lambda e: (e[1] == "displacement", e[0]),
        lambda e: (e[1] == "force", e[0]),
    ):
        bench = Bench(moves=True, wait=120)
        bench.feed(events, order)
        results.append(bench.read)
        assert bench.merger.counters.late == 0
        assert bench.reader.without_attitude == bench.reader.without_surface == 0
        assert max(errors(tool, bench.read)) < 1e-9
    assert all(str(result) == str(results[0]) for result in results)  # NaN is not equal to itself


def test_waiting_for_the_attitude_costs_nothing():
    """The merger of two numbers releases the same samples at the same moments."""
    tool, along = Turning(), Bench()
    events = events_of(tool, jitter=3.0)
    along.feed(events)
    plain = Bench()
    plain.reader.read = lambda _sample: None
    plain.feed([(*event[:3], 0.0) for event in events])
    assert along.released == plain.released
    waits = [now - stamp for stamp, now in along.released]
    assert max(waits) <= 20.0 + 3.0 + 8.0


def test_both_readings_of_a_moving_surface_are_of_its_own_time():
    """8 mm of breath at 30 Hz and 30 ms late."""
    tool, bench = Turning(breath_m=2e-5), Bench(moves=True, wait=120)  # 20 mm/s
    read = bench.feed(events_of(tool, surface_delay=30.0))
    assert len(read) > 850
    assert max(errors(tool, read)) < 1e-9
    assert bench.reader.without_surface == 0
    assert max(now - stamp for stamp, now in bench.released) <= 33.0 + 30.0 + 0.5


def test_poses_that_stay_away_hold_forces_no_longer_than_allowed_and_are_counted():
    tool, bench = Turning(), Bench(wait=50)
    events = [e for e in events_of(tool, delay=20.0) if e[1] == "force" or not 400 < e[2] < 480]
    read = bench.feed(events)
    late = bench.reader.without_attitude
    assert 20 < late < 35  # those of 394 to 450 ms: the next pose comes at 501
    wrong = [t for t, _, f in read if abs(f - tool.push(t)) > 1e-3]
    assert wrong  # turned by the nearest attitude
    assert len(wrong) <= late
    assert all(393 < t < 480 for t in wrong)
    assert max(now - stamp for stamp, now in bench.released) <= 52.0


def test_a_position_sensor_that_dies_and_comes_back():
    tool, bench = Turning(), Bench(wait=50, gap=100)
    events = [e for e in events_of(tool, 2000) if e[1] == "force" or not 400 < e[2] < 1200]
    read = bench.feed(events)
    stamps = [t for t, _, _ in read]
    assert not any(520 < t < 1199 for t in stamps)  # one sensor alone says nothing
    assert bench.merger.counters.unpaired > 300
    assert max(errors(tool, [one for one in read if not 393 < one[0] < 520])) < 1e-9
    assert bench.reader.without_attitude <= 51  # those of a tenth of a second


def test_messages_out_of_order_are_sorted_within_the_window():
    tool = Turning()
    poses = [e for e in events_of(tool) if e[1] == "displacement"]
    for first, second in zip(poses[20::10], poses[21::10], strict=True):  # change places
        poses[poses.index(first)] = (second[0] + 0.1, *first[1:])
    events = [e for e in events_of(tool) if e[1] == "force"] + poses
    bench = Bench(window=10)
    assert max(errors(tool, bench.feed(events))) < 1e-9
    assert bench.merger.counters.late == 0
    assert bench.reader.without_attitude == 0
    # Without a window the pose comes too late for its forces: it is dropped, and nothing breaks.
    bench = Bench(window=0)
    bench.feed(events)
    assert bench.merger.counters.late > 10


def test_an_attitude_that_jumps_is_not_turned_through():
    tool, bench = Turning(rate=0.0), Bench()
    flipped = (Rotation.from_euler("x", 179.0, degrees=True) * START).as_quat()
    events = [
        (*e[:3], ToolPose(e[3].place, unit_quaternion(flipped)))
        if e[1] == "displacement" and 500 < e[2] < 507
        else e
        for e in events_of(tool)
    ]
    read = bench.feed(events)
    wrong = [t for t, _, f in read if abs(f - tool.push(t)) > 1e-9]
    assert 2 <= len(wrong) <= 5  # those nearest to the one pose that is wrong
    assert all(495 < t < 510 for t in wrong)


def test_readings_that_are_no_numbers_go_on_for_the_estimator_to_refuse():
    tool, bench = Turning(), Bench()
    nowhere = (math.nan, 0.0, 0.0)
    events = []
    for arrival, stream, stamp, value in events_of(tool, 300):
        if stream == "force" and stamp == 100:
            value = nowhere
        if stream == "displacement" and 150 < stamp < 157:
            value = value._replace(place=nowhere)
        events.append((arrival, stream, stamp, value))
    read = bench.feed(events)
    without = [t for t, d, f in read if math.isnan(d) and math.isnan(f)]
    assert len(without) == 2  # one of each, and the forces around the pose are turned as ever
    assert max(errors(tool, [one for one in read if one[0] not in without])) < 1e-9


def test_a_clock_set_back_begins_anew_with_the_attitudes_of_the_new_time():
    tool, later = Turning(), Turning(rate=-0.4)
    bench = Bench()
    events = [(a, s, t + 9000.0, v) for a, s, t, v in events_of(tool, 400)]
    events += [(a + 500.0, s, t, v) for a, s, t, v in events_of(later, 400)]
    read = bench.feed(events)
    assert bench.merger.counters.resets >= 1
    new = [one for one in read if one[0] < 1000.0]
    assert len(new) > 200
    assert max(errors(later, new)) < 1e-9


def surface_at(ms, height=0.0, normal=UP):
    return ms * MS, SurfacePose((0.0, 0.0, height), normal), ms * MS


def tool_at(ms, arrival_ms=None):
    arrival_ms = ms if arrival_ms is None else arrival_ms
    return ms * MS, ToolPose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0)), arrival_ms * MS


def heights(bench, samples):
    """Where the surface was taken to be [m]."""
    bench.reader.frame = ContactFrame()
    along = [bench.reader.read(sample) for sample in samples]
    return [None if one is None else round(1e-3 * one.depth_mm, 9) for one in along]


def prompt(moves=True, **options):
    """A bench whose force sensor holds nobody up."""
    bench = Bench(moves=moves, gap=10_000, **options)
    bench.merger.add_force(5000 * MS, (0.0, 0.0, 0.0), 0)
    return bench


def test_a_reading_waits_for_the_surface_and_no_longer_than_allowed():
    bench = prompt(wait=50, silence=1000)
    merger = bench.merger
    assert merger.add_surface(*surface_at(0, 0.0)) == []
    assert merger.add_displacement(*tool_at(10)) == []
    assert heights(bench, merger.add_surface(*surface_at(20, 0.2))) == [0.1]
    assert bench.reader.without_surface == 0
    assert merger.add_displacement(*tool_at(30)) == []
    assert merger.add_displacement(*tool_at(79)) == []
    # A pose that came in time and waits to be taken in: this program is late, not the surface.
    assert merger.add_displacement(*tool_at(80), 45 * MS) == []
    assert heights(bench, merger.add_displacement(*tool_at(81))) == [0.2]
    assert bench.reader.without_surface == 1


def test_nobody_waits_for_a_surface_that_has_fallen_silent():
    bench = prompt(wait=5000, silence=100)
    merger = bench.merger
    merger.add_surface(*surface_at(0, 0.3))
    assert merger.add_displacement(*tool_at(90)) == []
    assert heights(bench, merger.add_displacement(*tool_at(110))) == [0.3, 0.3]
    assert heights(bench, merger.add_displacement(*tool_at(120))) == [0.3]
    # Other settings do not make it unknown.
    merger.clear()
    merger.add_force(6000 * MS, (0.0, 0.0, 0.0), 0)
    assert heights(bench, merger.add_displacement(*tool_at(130))) == [0.3]
    # It speaks again, and is waited for again.
    assert merger.add_surface(*surface_at(140, 0.4)) == []
    assert merger.add_displacement(*tool_at(150)) == []
    assert heights(bench, merger.add_surface(*surface_at(160, 0.6))) == [0.5]


def test_readings_before_the_first_pose_of_the_surface_are_dropped_and_counted():
    bench = prompt(wait=20)
    merger = bench.merger
    assert merger.add_displacement(*tool_at(10)) == []
    assert heights(bench, merger.add_displacement(*tool_at(40))) == [None]
    assert bench.reader.before_surface == 1


def test_the_surfaces_clock_set_back_begins_anew_and_its_poses_are_bounded():
    bench = prompt(wait=50)
    merger = bench.merger
    for ms in range(2000, 2000 + LONGEST_QUEUE + 500):
        merger.add_surface(*surface_at(ms, 0.1))
    assert len(merger._surface.waiting) == LONGEST_QUEUE
    merger.add_surface(*surface_at(100, 0.7))
    merger.add_surface(*surface_at(120, 0.9))
    assert heights(bench, merger.add_displacement(*tool_at(110))) == [0.8]


def test_a_surface_that_turns_over_has_the_nearer_normal_and_a_twist_does_not_count():
    def at(ms, *poses):
        before, after = (Reading(t * MS, SurfacePose((0.0, 0.0, 0.1 * t), n), 0) for t, n in poses)
        return pose_at(ms * MS, Around(before, after), surface_between)

    over = ((0, UP), (10, (0.0, 0.0, -1.0)))
    assert at(4, *over).normal == UP
    assert at(6, *over).normal == (0.0, 0.0, -1.0)
    tilted = at(5, (0, UP), (10, (math.sin(0.2), 0.0, math.cos(0.2))))
    assert tilted.normal == pytest.approx((math.sin(0.1), 0.0, math.cos(0.1)))
    assert tilted.point[2] == pytest.approx(0.5)


numbers = st.floats(-1.0, 1.0)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: math.hypot(*q) > 1e-2)


@given(quaternions, st.tuples(numbers, numbers, numbers), st.floats(0.0, 1.0), st.booleans())
def test_attitudes_between_two_are_those_of_scipy(first, turn, share, negative):
    before = Rotation.from_quat(first)
    after = before * Rotation.from_rotvec(np.array(turn) * 0.5 * math.pi / math.sqrt(3.0))
    between = Slerp([0.0, 1.0], Rotation.concatenate([before, after]))(share)
    second = tuple(-after.as_quat() if negative else after.as_quat())
    found = attitude_between(unit_quaternion(first), second, share)
    assert math.hypot(*found) == pytest.approx(1.0, abs=1e-8)
    assert (Rotation.from_quat(found).inv() * between).magnitude() < 1e-7
