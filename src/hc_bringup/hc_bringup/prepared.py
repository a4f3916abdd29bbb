"""What a recording says of its contact position and delay, for an estimator that considers it."""

from __future__ import annotations

import argparse
from collections.abc import Collection

from hc_bringup.recording_input import known_delay
from hc_estimator import Estimator
from hc_estimator.stream.vocabulary import CHANNEL_DELAY, CONTACT_POSITION_STD
from hc_logger.recorded import Recording


def prepare(
    estimator: Estimator,
    given: Collection[str],
    recording: Recording,
    arguments: argparse.Namespace,
) -> None:
    """Set how well the contact position was found, and the delay that the bag's node was set to.

    Args:
        estimator: just made.
        given: settings that are the user's own.
        recording: what it is for.
        arguments: how it was read.

    Raises:
        ValueError: if a value cannot be.
    """
    left_open = estimator.configuration.keys() - set(given)
    if CONTACT_POSITION_STD in left_open:
        estimator.reconfigure(**{CONTACT_POSITION_STD: recording.surface_std_mm})
    if CHANNEL_DELAY in left_open:
        estimator.reconfigure(channel_delay=known_delay(arguments, recording))
