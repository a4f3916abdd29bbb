"""A recording whose parameters are not the tissue's, for commands that make more of them.

A table of contacts, a map or a comparison of filters looks sound whatever it was made of: a channel
that counts the other way gives contacts with K of nothing, and some filter that foretells best.
"""

from __future__ import annotations

import math
import sys
from typing import Any

from hc_bringup.summary import why_unusable


def say_unusable(name: str, recording: Any) -> str:
    """Say on standard error what makes the parameters useless; the reason in a few words.

    What moving the tool takes, or a filter of a sensor, is said as well, for it is in every
    contact. What else is only doubted is not: zeros may be found place by place, and the law is
    judged by what is made of the recording.

    Args:
        name: what the recording is called.
        recording: hc_logger.recorded.Recording.

    Returns:
        The reason as `why_unusable` has it; nothing where there is none.
    """
    from hc_estimator.stream.readings import MEANINGS
    from hc_estimator.stream.sanity import LOOKS_LATE

    doubts = doubts_of(recording)
    serious = [doubt for doubt in doubts if why_unusable([doubt.check.value], math.nan)]
    said = [*serious, *(doubt for doubt in doubts if doubt.check in LOOKS_LATE)]
    for doubt in said:
        print(f"{name}: {doubt.sentence}", file=sys.stderr)
    if said:
        print(f"{name}: what each means and what to do: {MEANINGS}", file=sys.stderr)
    return why_unusable((doubt.check.value for doubt in serious), math.nan)


def doubts_of(recording: Any, force_limit_n: float = math.inf) -> list[Any]:
    """Return what of a recording's readings cannot be right (hc_estimator.stream.readings).

    Args:
        recording: hc_logger.recorded.Recording.
        force_limit_n: the estimator's; a range of the sensor that ends beyond it does no harm.
    """
    from hc_bringup.reading_changes import read_alike, unexplained
    from hc_estimator.stream.sanity import check_samples

    origin_ns = int(recording.stamps[0]) if len(recording.stamps) else 0
    found = check_samples(*read_alike(recording), force_limit_n, recording.counted_once)
    return unexplained(found, recording.reading_changes, origin_ns)


def say_unread(name: str, recording: Any) -> None:
    """Say on standard error what of a bag could not be read: what is made of it lacks that.

    Args:
        name: what the recording is called.
        recording: hc_logger.recorded.Recording.
    """
    for line in (*recording.findings.problems, *recording.findings.being_recorded):
        print(f"{name}: {line}", file=sys.stderr)
