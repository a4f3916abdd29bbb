"""Numbers as text: decimals that stay put, forces and times in engineering units."""

from __future__ import annotations

import math
from typing import Final

NOTHING: Final = "–"
MOST_DECIMALS: Final = 7
LONGEST: Final = 11
_PREFIXES: Final = {-9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}


def engineering(value: float, unit: str, digits: int = 3) -> str:
    """Return a quantity with a prefix, 12.1 mN for 0.0121 N; three digits however large it is."""
    if not math.isfinite(value):
        return NOTHING
    if value == 0.0:
        return f"0 {unit}"
    power = max(-9, min(6, 3 * math.floor(math.log10(abs(value)) / 3)))
    scaled = value / 10.0**power
    if round(abs(scaled), digits - 1) >= 1000.0 and power < 6:
        power += 3
        scaled = value / 10.0**power
    if abs(scaled) >= 1e4:
        return f"{scaled:.{digits}g} {_PREFIXES[power]}{unit}"
    places = max(0, digits - 1 - math.floor(math.log10(abs(scaled))))
    return f"{scaled:.{min(places, digits)}f} {_PREFIXES[power]}{unit}"


def counted(number: int, what: str, thousands: str = "") -> str:
    """Return how many of what: 1 recording, 2 recordings.

    Args:
        number: of them.
        what: the word for one, whose plural ends with s.
        thousands: sign between thousands.
    """
    return f"{number:{thousands}} {what}{'' if number == 1 else 's'}"


def decimals_of(value: float, deviation: float) -> int:
    """Return the decimals by which a value is told: two digits of its deviation."""
    size = deviation if deviation > 0.0 and math.isfinite(deviation) else abs(value) / 1000.0
    if not (size > 0.0 and math.isfinite(size)):
        return 3
    return max(0, min(MOST_DECIMALS, 1 - math.floor(math.log10(size))))


def with_spread(value: float, spread: float) -> str:
    """Return a value and its spread with the same decimals: two digits of the spread."""
    places = decimals_of(value, spread)
    return f"{fixed(value, places)} ± {fixed(spread, places)}"


class SteadyDecimals:
    """Decimals of one number that do not jump to and fro with its uncertainty."""

    def __init__(self) -> None:
        self._decimals: int | None = None

    def update(self, value: float, deviation: float) -> int:
        """Return how many decimals to show now: what was shown before, unless far off."""
        wanted = decimals_of(value, deviation)
        if self._decimals is None or abs(wanted - self._decimals) > 1:
            self._decimals = wanted
        return self._decimals


def fixed(value: float, decimals: int) -> str:
    """Return a number with so many decimals, or a dash; one that gets too long, by its power."""
    if not math.isfinite(value):
        return NOTHING
    text = f"{value:.{decimals}f}" if abs(value) < 1e9 else ""
    return text if 0 < len(text) <= LONGEST else f"{value:.3g}"


def rounded(value: float, decimals: int) -> float:
    """Return a number as it is written down: so many decimals, or three digits of a smaller one."""
    if value == 0.0 or not math.isfinite(value):
        return value
    return round(value, max(decimals, 2 - math.floor(math.log10(abs(value)))))


def file_size(size: float) -> str:
    """Return a size in bytes as people say it."""
    for unit in ("B", "kB", "MB"):
        if size < 1000.0:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.1f} {unit}"
        size /= 1000.0
    return f"{size:.2f} GB"
