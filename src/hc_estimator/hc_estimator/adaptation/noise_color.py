"""Is a sensor's noise white? How much of it is left at the frequencies at which a tool moves.

A sensor that filters its readings (an anti-aliasing or a low-pass filter, as nearly all force
sensors have one), or that takes up the mains, has noise whose neighbours go together: their
differences show little of it (`difference_noise`), and what differences do not show was taken for a
contact law that does not fit. (Of a force sensor of 10 mN with a low-pass of 73 Hz, read at 1 kHz,
a misfit was said in 88 % of the time, and K was within three deviations in 97 % of the samples; of
one of 32 Hz in all of the time, and in 86 %.)

So the same differences are taken of means of two, four, eight and more readings: white noise says
the same there. Up to 8 ms nothing of a tool is in them but corners: where it touches and leaves the
tissue the force's octaves begin anew, and what is far beyond the noise known so far is a corner as
well, behind which an octave goes on. What the largest of them says beyond the readings' own
differences, and beyond chance, is the factor by which the noise counts.

Most force sensors filter slower than that, or are read at 60 to 250 Hz. So wider means of the force
are asked as well, and a motion is told from noise by its growth from one octave to the next: that
of a tool is sixteenfold at least (the spectrum of a hand falls with the fourth power of the
frequency, that of smooth presses with the sixth), that of noise behind a filter of the first order
at most fourfold, and behind one of the second order sixteenfold until it settles. An octave counts
once the next one is known, less a share of what that one may have grown from; beyond one that grows
more than any noise does, nothing does. Not so for a place: a hand that trembles at 8 Hz grows like
noise, and settles. Nor does what it makes of the force count: the place's octaves say how the tool
moves in such a time, and what the law makes of that is no noise. (A hand that tapped and trembled
made a sensor of 10 mN pass for one of 0.2 N.)

(Ours; a bank of octaves, as the Allan variance is, IEEE Std 952.)
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hc_estimator.adaptation import difference_noise
from hc_estimator.adaptation.difference_noise import ORDER
from hc_estimator.compilation import compiled
from hc_estimator.mean_squares import largest_by_noise
from hc_estimator.memory import Field, record_type

OCTAVES = 7  # 2 to 128 readings: 18 ms at 7 kHz
NO_MOTION = 0.0085  # time between two means up to which nothing of a tool is in them [s]
WIDEST = 0.15  # time between two means, at most [s]
# Growth from one octave to the next, of a variance that white noise would leave as it is:
SETTLED = 4.5  # up to which there is nothing but noise: a filter of the first order makes four
MOTION_GROWTH = 7.0  # of a motion, at least (sixteen, less chance)
STEEPEST = 20.0  # which no noise has: a filter of the second order makes sixteen
COLORED = 30.0  # variance of an octave of a place, over that of its noise, that noise may make
CLEARLY = 2.0  # times what the tool's motion makes, from which on there is noise beside it
BLOCK = 32  # differences of means that are averaged
BLOCKS = 16  # averages, of which the median counts: what a tool does at once spoils one or two
NEXT_TO = 0.8  # of a time between two means, from which on another is as good
FEWEST = 3  # of them that say something
FEWEST_NEXT = 2  # of them that say whether the octave before was noise
MEDIAN = 0.64  # information of a median over that of a mean
CORNER = 9.0  # of one squared difference against the mean, from which on it is of a corner
CORNERS = 3  # in a row that are none: the noise is another
# One over the share of eighth differences that are independent: sum of their squared correlations.
DEPENDENT = 4.4
SURELY = 4.0  # deviations of a mean square (`mean_squares`) beyond which noise is not white

COLOR = record_type(
    (
        Field("waiting", np.float64, (OCTAVES,)),  # the first of two that make a mean
        Field("waits", np.int64, (OCTAVES,), 0, 1),  # 1 where there is one
        Field("means", np.float64, (OCTAVES, ORDER + 1)),  # the last ones, oldest first
        Field("following", np.int64, (OCTAVES,), 0, ORDER + 1),  # of them, that follow one another
        # In the present block: sum of the squares, and their number.
        Field("squares", np.float64, (OCTAVES,), 0.0),
        Field("taken", np.int64, (OCTAVES,), 0, BLOCK),
        Field("blocks", np.float64, (OCTAVES, BLOCKS), 0.0),  # ring of their means
        Field("count", np.int64, (OCTAVES,), 0),  # blocks so far
        Field("variance", np.float64, (OCTAVES,), 0.0),  # of white noise that would say the same
        # Of it, what the motion of the tool makes; infinite where that is not known, or is all.
        Field("moved", np.float64, (OCTAVES,), 0.0, finite=False),
        Field("touches", np.int64, (), 0, 1),
        Field("corners", np.int64, (OCTAVES,), 0, CORNERS),  # in a row
    )
)


@compiled
def restart(color: Any) -> None:
    """Forget what was said."""
    for k in range(OCTAVES):
        color.count[k] = 0
        color.variance[k] = 0.0
        color.squares[k] = 0.0
        color.taken[k] = 0
        color.corners[k] = 0
    interrupt(color)


@compiled
def limit_to_short_times(color: Any) -> None:
    """Take nothing in longer times for noise, as of a place."""
    for k in range(OCTAVES):
        color.moved[k] = math.inf


@compiled
def interrupt(color: Any) -> None:
    """What comes next does not follow what was before."""
    for k in range(OCTAVES):
        color.waits[k] = 0
        color.following[k] = 0


@compiled
def learn(color: Any, channel: Any, reading: float, touches: bool) -> bool:
    """Take a reading after `difference_noise.learn` has.

    Args:
        color: changed.
        channel: record of the same channel in `difference_noise`.
        reading: displacement [mm] or force [N].
        touches: True while a force is felt; where that changes nothing is compared.

    Returns:
        True if the variance of an octave has changed.
    """
    if channel.jumped != 0:
        restart(color)
    inside = 1 if touches else 0
    if not difference_noise.follows(channel) or inside != color.touches:
        interrupt(color)
    color.touches = inside
    value, changed = reading, False
    for k in range(OCTAVES):
        if interval(channel, k) > WIDEST:
            break
        if color.waits[k] == 0:
            color.waiting[k] = value
            color.waits[k] = 1
            break
        value = 0.5 * (color.waiting[k] + value)
        color.waits[k] = 0
        changed = _take_mean(color, k, value) or changed
    return changed


@compiled
def interval(channel: Any, k: int) -> float:
    """Time between two means of an octave [s]."""
    return 2.0 ** (k + 1) * channel.step  # type: ignore[no-any-return]


@compiled
def _take_mean(color: Any, k: int, value: float) -> bool:
    """Take a mean of an octave into its variance; True if that has changed."""
    difference_noise.append(color.means[k], value)
    color.following[k] = min(color.following[k] + 1, ORDER + 1)
    if color.following[k] <= ORDER:
        return False
    square = 2.0 ** (k + 1) * difference_noise.variance_of(color.means[k])
    if color.variance[k] > 0.0 and square > CORNER * color.variance[k]:
        color.following[k] = 0
        color.corners[k] = min(color.corners[k] + 1, CORNERS)
        if color.corners[k] < CORNERS:
            return False
    else:
        color.corners[k] = 0
    color.squares[k] += square
    color.taken[k] += 1
    if color.taken[k] < BLOCK:
        return False
    color.blocks[k, color.count[k] % BLOCKS] = color.squares[k] / BLOCK
    color.count[k] += 1
    color.squares[k] = 0.0
    color.taken[k] = 0
    color.variance[k] = _median(color.blocks[k], min(color.count[k], BLOCKS))
    return True


@compiled
def _median(values: Any, count: int) -> float:
    """Median of the first values; of an even number the lower one."""
    for i in range(count):
        lower, equal = 0, 0
        for j in range(count):
            lower += 1 if values[j] < values[i] else 0
            equal += 1 if values[j] == values[i] else 0
        if 2 * lower < count and 2 * (lower + equal) >= count:
            return values[i]  # type: ignore[no-any-return]
    return 0.0


@compiled
def of_means(color: Any, channel: Any, variance: float) -> float:
    """Variance that counts in means of readings; 0 for white noise, of which they tell themselves.

    Args:
        color: of the channel.
        channel: its record in `difference_noise`.
        variance: in use.
    """
    return variance if factor(color, channel) > 1.0 else 0.0


@compiled
def factor(color: Any, channel: Any) -> float:
    """By how much the noise's variance is larger, for what moves as a tool does, than it seems."""
    largest, before, likely = 1.0, 1.0, 1.0
    for k in range(OCTAVES):
        if color.count[k] < FEWEST_NEXT:
            break
        ratio = color.variance[k] / channel.mean
        growth = ratio / before
        if growth > SETTLED:  # a motion may have begun in the octave before
            likely -= ratio / MOTION_GROWTH
        largest = max(largest, likely)
        wide = interval(channel, k) > NO_MOTION
        moves = wide and (growth > STEEPEST or color.variance[k] < CLEARLY * color.moved[k])
        if color.count[k] < FEWEST or moves:
            break
        before, likely = ratio, 1.0
        if ratio > largest_by_noise(_freedom(color, k), SURELY):
            likely = ratio
            if wide:
                likely -= color.moved[k] / channel.mean
            else:
                largest = max(largest, ratio)
    return largest


@compiled
def _freedom(color: Any, k: int) -> float:
    """Degrees of freedom of an octave's variance."""
    return MEDIAN * BLOCK / DEPENDENT * min(color.count[k], BLOCKS)  # type: ignore[no-any-return]


@compiled
def deviation_by_motion(color: Any, channel: Any, time: float) -> float:
    """How far a tool moves from one mean to the next [mm]; infinite if unknown.

    A place may have noise that goes together as well: less than that makes is no motion.

    Args:
        color: of the displacement.
        channel: its record in `difference_noise`.
        time: between two means [s]; of octaves beside it the wider one is asked.
    """
    k = 0
    while k < OCTAVES - 1 and interval(channel, k) < NEXT_TO * time:
        k += 1
    if color.count[k] < FEWEST_NEXT:
        return math.inf
    if color.variance[k] < COLORED * channel.mean:
        return 0.0
    return math.sqrt((color.variance[k] - channel.mean) / 2.0 ** (k + 1))
