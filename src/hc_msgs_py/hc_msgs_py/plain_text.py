"""Text of others, as a terminal may have it: what would move, hide or rename is shown as a code.

Names of files, topics and types may hold any character. Written to a terminal as they are, some of
them wipe what stands there, set its title or clipboard, or turn the order of what is read.
"""

from __future__ import annotations

import re
from typing import Final

_COMMANDS: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
)
"""Control characters but tab and line feed, and those that turn the order of text."""


def visible(text: str) -> str:
    """Return a text with its control characters as codes of JSON; tabs and line feeds stay."""
    return _COMMANDS.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def in_one_line(text: str) -> str:
    """Return a name as `visible` does, its line feeds as codes too."""
    return visible(text).replace("\n", "\\u000a")
