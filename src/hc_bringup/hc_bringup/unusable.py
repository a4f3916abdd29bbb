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

    What is only doubted is not said here: zeros may be found place by place, and the law is judged
    by what is made of the recording.

    Args:
        name: what the recording is called.
        recording: hc_logger.recorded.Recording.

    Returns:
        The reason as `why_unusable` has it; nothing where there is none.
    """
    from hc_bringup.reading_changes import read_alike
    from hc_estimator.stream.readings import MEANINGS
    from hc_estimator.stream.sanity import check_samples

    doubts = check_samples(*read_alike(recording))
    serious = [doubt for doubt in doubts if why_unusable([doubt.check.value], math.nan)]
    for doubt in serious:
        print(f"{name}: {doubt.sentence}", file=sys.stderr)
    if serious:
        print(f"{name}: what each means and what to do: {MEANINGS}", file=sys.stderr)
    return why_unusable((doubt.check.value for doubt in serious), math.nan)


def say_unread(name: str, recording: Any) -> None:
    """Say on standard error what of a bag could not be read: what is made of it lacks that.

    Args:
        name: what the recording is called.
        recording: hc_logger.recorded.Recording.
    """
    for line in (*recording.findings.problems, *recording.findings.being_recorded):
        print(f"{name}: {line}", file=sys.stderr)
