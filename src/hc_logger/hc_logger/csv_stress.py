"""Columns of stress and strain, as testing machines export them: what makes readings of them.

The law is one of force and depth; which sample a stress and a strain are of, a table does not say.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

_STRESS: Final = re.compile(r"\b(stress|spannung|druckspannung|contrainte|tension mécanique)\b")
_STRAIN: Final = re.compile(r"\b(strain|dehnung|stauchung|déformation relative)\b")
_PASCAL: Final = re.compile(r"(?<![A-Za-z])(Pa|kPa|MPa|N/mm²|N/mm2|N/mm\^2)(?![A-Za-z])")
_TIMES_MM2: Final = {"Pa": "uN", "kPa": "mN"}
"""What a stress in a unit times an area in mm² is in; N for MPa and N/mm²."""


def why_no_force(cells: Sequence[str], units: Sequence[str]) -> str:
    """Say of a table without a force that it has a stress; nothing if it has none.

    Args:
        cells: names of the columns.
        units: what stands below each, if anything does.
    """
    for i, cell in enumerate(cells):
        unit = _PASCAL.search(_words(cell)) or _PASCAL.search(_at(units, i))
        if unit or _STRESS.search(_words(cell).lower()):
            force = _TIMES_MM2.get(unit[0], "N") if unit else "..."
            return (
                f"{cell[:30]!r} is a stress, and a stress times the area is a force: say --columns "
                f"force={i + 1} --units force={force} --input force.scale=AREA, with the area of "
                "the contact in mm² (Pa times mm² are uN, kPa mN, MPa N)"
            )
    return ""


def why_no_displacement(cells: Sequence[str], units: Sequence[str]) -> str:
    """Say of a table without a displacement that it has a strain; nothing if it has none.

    Args:
        cells: names of the columns.
        units: what stands below each, if anything does.
    """
    for i, cell in enumerate(cells):
        if _STRAIN.search(_words(cell).lower()):
            share = ", a hundredth of it for %" if "%" in cell + _at(units, i) else ""
            return (
                f"{cell[:30]!r} is a strain, and a strain times the height of the sample is a "
                f"displacement: say --columns displacement={i + 1} --units displacement=mm --input "
                f"position.scale=HEIGHT, with the height in mm{share}"
            )
    return ""


def _words(cell: str) -> str:
    return cell.replace("_", " ")


def _at(units: Sequence[str], index: int) -> str:
    return units[index] if index < len(units) else ""
