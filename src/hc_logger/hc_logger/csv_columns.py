"""Which columns of a CSV file a quantity may be in: by what they are called, else by their unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

from hc_logger.csv_layout import NO_COLUMN
from hc_logger.csv_vocabulary import NAMES, NOT_MEASURED, is_weight, split_name, unit_of

_STATUS: Final = re.compile(r"status(?: code| word)?[\s_]*[(\[]?hex[)\]]?", re.IGNORECASE)
"""What ATI's programs call the column of the sensor's status words."""

_HEXADECIMAL: Final = re.compile(r"(?:0[xX])?[0-9a-fA-F]{1,8}")
_ANY_ERROR: Final = 1 << 31


def status_column(names: Sequence[str]) -> int:
    """Return the column of a force sensor's status words, NO_COLUMN if none is called so.

    Args:
        names: of all columns.
    """
    return next((i for i, name in enumerate(names) if _STATUS.fullmatch(name.strip())), NO_COLUMN)


def tells_an_error(word: str) -> bool:
    """Whether a status word of an ATI sensor says that its force is none.

    Bit 31 is set with each bit that is an error: a gage or a force out of range, a broken gage. A
    latched monitor condition and a simulated error are none (ATI's manual of the Ethernet Axia).
    """
    return bool(_HEXADECIMAL.fullmatch(word) and int(word, 16) & _ANY_ERROR)


def candidates(
    quantity: str, names: Sequence[str], numeric: Sequence[int], units: Sequence[str] = ()
) -> tuple[list[int], str]:
    """Return the columns that a quantity may be in, and why one of several was taken.

    Args:
        quantity: one of QUANTITIES.
        names: of all columns.
        numeric: the columns that hold numbers.
        units: of all columns, from a line of their own; empty if there is none.

    Returns:
        The columns, one if it is clear; and a note, empty if none of several was taken.
    """
    plain = {i: split_name(names[i], quantity)[0] for i in numeric if i < len(names)}
    known = [i for i, name in plain.items() if name == quantity]
    known = known or [i for i, name in plain.items() if name in NAMES[quantity]]
    known = known or [i for i, name in plain.items() if _contains(name, quantity)]
    if not known:
        by_unit = [i for i in plain if _is_in_unit_of(names[i], units[i : i + 1], quantity)]
        note = f"{names[by_unit[0]]!r} is taken for the {quantity} by its unit" if by_unit else ""
        return by_unit, note if len(by_unit) == 1 else ""
    if len(known) > 1:
        pressed = [i for i in known if plain[i].startswith("compress")]
        if len(pressed) == 1:
            return pressed, f"of {len(known)} columns of {quantity} the one of compression"
        axes = {i: plain[i].replace("(", " ").replace(")", " ").split()[-1] for i in known}
        along_z = [i for i in known if axes[i] == "z"]
        if len(along_z) == 1 and all(axis in ("x", "y", "z") for axis in axes.values()):
            return along_z, f"of {len(known)} columns of {quantity} the one along z"
    return known, ""


def _is_in_unit_of(name: str, below: Sequence[str], quantity: str) -> bool:
    """Whether a column has a unit of a quantity, and its name does not say that it is another.

    Masses are left out: a column of grams need not be a force.
    """
    words, unit = split_name(name, quantity)
    given = below[0] if below else ""
    if is_weight(given or name) or not NOT_MEASURED.isdisjoint(words.split()):
        return False
    return (unit or unit_of(given, quantity)) is not None


def _contains(name: str, quantity: str) -> bool:
    words = name.split()
    if not NOT_MEASURED.isdisjoint(words):
        return False
    return any(word in words for word in NAMES[quantity] if len(word) > 1)
