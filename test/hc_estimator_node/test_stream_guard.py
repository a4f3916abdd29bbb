"""What belongs to a stream of samples, what is stray, and what is a new beginning."""

import random

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hc_estimator.stream.stream_guard import Break, StreamGuard, StreamSample

MS = 1_000_000
START = 1_700_000_000_000_000_000


def sample(milliseconds, sequence):
    return StreamSample(START + milliseconds * MS, sequence, 1.0, 2.0)


@pytest.fixture
def guard():
    return StreamGuard(maximum_gap_ns=10_000 * MS)


def feed(guard, samples):
    """Feed samples as the session does; return those used and the breaks met."""
    used, breaks = [], []
    for one in samples:
        if guard.is_next(one.stamp_ns, one.sequence):
            used.append(one)
        else:
            now, broken = guard.push(one)
            used.extend(now)
            if broken is not Break.NONE:
                breaks.append(broken)
    return used, breaks


def test_takes_an_undisturbed_stream_as_it_is(guard):
    samples = [sample(i, i) for i in range(100)]
    assert feed(guard, samples) == (samples, [])
    assert (guard.lost, guard.strays) == (0, 0)


def test_counts_missing_sequence_numbers_as_lost(guard):
    samples = [sample(i, i) for i in range(100) if i not in (20, 21, 50)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == 3


def test_hands_late_and_repeated_samples_on_to_the_estimator_to_reject(guard):
    samples = [sample(0, 0), sample(1, 1), sample(1, 1), sample(0, 0), sample(2, 2)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == 0


def test_drops_a_single_stamp_out_of_place_and_goes_on(guard):
    samples = [sample(i, i) for i in range(10)]
    stray = sample(10_000_000, 10)
    used, breaks = feed(guard, [*samples, stray, *(sample(i, i) for i in range(11, 20))])
    assert stray not in used
    assert breaks == []
    assert guard.strays == 1
    assert len(used) == 19


@pytest.mark.parametrize("jump_ms", [-5_000_000, 5_000_000])
def test_a_confirmed_jump_of_the_stamps_loses_no_sample(guard, jump_ms):
    before = [sample(i, i) for i in range(10)]
    after = [sample(jump_ms + i, i) for i in range(10, 30)]
    used, breaks = feed(guard, before + after)
    assert used == before + after
    assert breaks == [Break.TIME_JUMP]
    assert (guard.lost, guard.strays) == (0, 0)


def test_a_bag_that_loops_is_a_time_jump_each_time(guard):
    bag = [sample(i, i) for i in range(1000)]
    used, breaks = feed(guard, bag * 3)
    assert used == bag * 3
    assert breaks == [Break.TIME_JUMP] * 2
    assert guard.lost == 0


def test_a_restarted_publisher_is_taken_over_without_loss(guard):
    before = [sample(i, i) for i in range(500)]
    after = [sample(2000 + i, i) for i in range(500)]
    used, breaks = feed(guard, before + after)
    assert used == before + after
    assert breaks == [Break.RESTARTED]
    assert guard.lost == 0


def test_the_first_of_two_interleaved_publishers_keeps_the_floor(guard):
    first = [sample(i, i) for i in range(1000)]
    other = [StreamSample(s.stamp_ns + 300_000, s.sequence + 5_000_000, 9.0, 9.0) for s in first]
    mixed = [one for pair in zip(first, other, strict=True) for one in pair]
    used, breaks = feed(guard, mixed)
    assert used == first
    assert breaks == []
    assert guard.strays == 999  # the last one is still held


def test_a_source_that_does_not_count_is_taken_by_its_stamps(guard):
    samples = [sample(i, 0) for i in range(100)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == 0


def test_a_gap_that_was_announced_is_no_loss(guard):
    feed(guard, [sample(i, i) for i in range(10)])
    guard.expect_gap(30)
    samples = [sample(i, i) for i in range(40, 50)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == 0


def test_a_gap_announced_after_the_number_0_is_no_loss(guard):
    """Regression: what was skipped at the start of a stream was counted as lost as well."""
    feed(guard, [sample(0, 0)])
    guard.expect_gap(3)
    guard.expect_gap(2)
    samples = [sample(i, i) for i in range(6, 20)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == 0
    feed(guard, [sample(25, 25)])
    assert guard.lost == 5


def test_what_is_lost_beside_an_announced_gap_after_the_number_0_is_counted(guard):
    feed(guard, [sample(0, 0)])
    guard.expect_gap(3)
    feed(guard, [sample(7, 7)])
    assert guard.lost == 3


def test_a_source_that_does_not_count_may_have_a_gap_announced_too(guard):
    """Regression of 2026-11-26: it was told to number anew, and five samples waited for that."""
    feed(guard, [sample(i, 0) for i in range(10)])
    guard.expect_gap(30)
    samples = [sample(i, 0) for i in range(40, 50)]
    assert feed(guard, samples) == (samples, [])
    assert guard.lost == guard.strays == 0


def test_forget_takes_the_next_sample_wherever_it_is(guard):
    feed(guard, [sample(i, i) for i in range(10)])
    guard.forget()
    far = sample(-9_000_000, 3)
    assert feed(guard, [far]) == ([far], [])


def test_random_numbers_are_no_count_and_lose_nothing(guard):
    """Once 14 samples with random 64-bit numbers confirmed one another, 7e10 counted as lost."""
    generator = random.Random(4)
    samples = [sample(i, generator.getrandbits(64)) for i in range(5000)]
    used, breaks = feed(guard, samples)
    assert not guard.counted
    assert guard.lost == 0
    assert len(used) > 4900
    assert breaks == []
    assert guard.faults.odd_numbers > 0
    # A source that begins to count is believed again, and its losses are told.
    after = [sample(5000 + i, i) for i in range(200) if i != 150]
    assert len(feed(guard, after)[0]) == 199
    assert guard.counted
    assert guard.lost == 1


@pytest.mark.parametrize("bits", [4, 8, 12, 16])
def test_small_random_numbers_do_not_pile_up_losses(guard, bits):
    generator = random.Random(bits)
    used, _breaks = feed(guard, [sample(i, generator.getrandbits(bits)) for i in range(5000)])
    assert not guard.counted
    assert len(used) > 4900
    assert guard.lost < 5000  # of those before the numbers were found out


def test_a_known_rate_says_how_far_numbers_may_run(guard):
    feed(guard, [sample(i, i) for i in range(200)])
    lossy = [sample(i, i) for i in range(900, 1000)]  # 700 lost in 0.7 s
    assert feed(guard, lossy) == (lossy, [])
    assert guard.lost == 700
    feed(guard, [sample(1000, 1700)])  # 700 in one millisecond: not lost, but another's
    assert guard.lost == 700


def test_zero_stamps_are_counted_as_what_they_are(guard):
    zeros = [StreamSample(0, i, 1.0, 2.0) for i in range(100)]
    assert feed(guard, zeros)[0] == zeros[:1]  # simulated time begins at zero
    assert guard.faults.zero_stamps == 99
    after = [sample(i, 100 + i) for i in range(20)]
    assert feed(guard, after) == (after, [Break.TIME_JUMP])
    feed(guard, [StreamSample(0, 120 + i, 1.0, 2.0) for i in range(50)])
    assert guard.faults.zero_stamps == 149


def test_random_stamps_are_jumps_with_their_size(guard):
    generator = random.Random(1)
    used, _breaks = feed(
        guard, [sample(generator.randrange(-(10**9), 10**9), i) for i in range(1000)]
    )
    assert len(used) < 50
    assert guard.faults.stamp_jumps > 900
    assert guard.faults.largest_jump_ns > 10**8 * MS


@given(
    st.lists(
        st.tuples(st.integers(-(10**7), 10**7), st.integers(0, 10**6)), min_size=1, max_size=200
    )
)
def test_every_sample_is_used_held_or_counted_as_stray_whatever_comes(moments):
    guard = StreamGuard(maximum_gap_ns=10_000 * MS)
    samples = [sample(*moment) for moment in moments]
    used, _breaks = feed(guard, samples)
    held = len(samples) - len(used) - guard.strays
    assert 0 <= held < guard.confirmations
    assert guard.lost >= 0
