"""What a file may make of itself when it is read: bounds against decompression bombs.

A few bytes can claim gigabytes. Chunks are bounded by what they claim, by how often they unpack to
their own size, and by a limit; what is kept in memory of a whole recording by another. Both limits
are settings, for who has files that are larger in earnest.
"""

from __future__ import annotations

import os
from typing import Final

from hc_logger.errors import BagError

MIB: Final = 1024 * 1024
CHUNK_SETTING: Final = "HC_LARGEST_CHUNK_MIB"
CHUNK_MIB: Final = 256
"""Writers make chunks of 1 to 16 MiB; one message is never split, so images can be more."""
RECORDING_SETTING: Final = "HC_LARGEST_RECORDING_MIB"
RECORDING_MIB: Final = 4096
"""17 hours of samples at 1 kHz."""
UNSUSPICIOUS_BYTES: Final = 16 * MIB
LARGEST_RATIO: Final = 1000
"""Of unpacked to packed size beyond UNSUSPICIOUS_BYTES: a chunk of black images comes near it."""
MOST_RECORDS: Final = 1_000_000
"""In one chunk: the shortest messages make 31 MB of so many."""


def largest_chunk() -> int:
    """Return how many bytes a chunk may unpack to.

    Raises:
        BagError: if the setting is no number.
    """
    return _setting(CHUNK_SETTING, CHUNK_MIB)


def largest_recording() -> int:
    """Return how many bytes of a recording may be kept in memory.

    Raises:
        BagError: if the setting is no number.
    """
    return _setting(RECORDING_SETTING, RECORDING_MIB)


def check_in_memory(size: int, what: str) -> None:
    """See that something may be kept in memory.

    Args:
        size: bytes so far.
        what: what it is, for the message.

    Raises:
        BagError: if it is too much; names the setting.
    """
    most = largest_recording()
    if size > most:
        raise BagError(
            f"{what} holds more than {most // MIB} MiB: set {RECORDING_SETTING} to read it all "
            "the same, or take a part"
        )


def why_not_unpack(packed: int, unpacked: int) -> str:
    """Say why a chunk of these sizes is not unpacked; empty if it may be.

    Raises:
        BagError: if the setting is no number.
    """
    most = largest_chunk()
    if unpacked > most:
        return (
            f"it says that it unpacks to {unpacked} bytes, and the limit is {most // MIB} MiB "
            f"({CHUNK_SETTING})"
        )
    if unpacked > UNSUSPICIOUS_BYTES and unpacked > LARGEST_RATIO * packed:
        return f"it says that it unpacks to {unpacked // max(packed, 1)} times its size"
    return ""


def _setting(name: str, default: int) -> int:
    text = os.environ.get(name, "").strip()
    if not text:
        return default * MIB
    if not (text.isascii() and text.isdigit() and 0 < int(text) < 2**31):
        raise BagError(f"{name}={text[:40]!r} is no size: give whole MiB, for example {default}")
    return int(text) * MIB
