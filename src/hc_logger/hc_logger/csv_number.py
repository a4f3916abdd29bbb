"""What stands in a cell of a CSV file: a number in somebody's way of writing, or a time of day."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Final, NamedTuple

from hc_msgs_py.units import DAY_S

MISSING: Final = ("", "-", "--", "---", "n/a", "#n/a", "na")
"""What is written where there is no reading, in lower case."""
MINUS: Final = "\N{MINUS SIGN}"
"""What some programs write before a number, in Swedish settings for example."""
_PLAIN_GROUP_SIGNS: Final = (
    " '\N{RIGHT SINGLE QUOTATION MARK}\N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}"
)
"""Between thousands, and never a decimal sign."""
_OTHER_SIGN: Final = {".": ",", ",": "."}
_GROUP_SIGNS: Final = {decimal: _OTHER_SIGN[decimal] + _PLAIN_GROUP_SIGNS for decimal in ".,"}
_GROUPED: Final = {
    (decimal, sign): re.compile(
        rf"(?P<whole>[-+]?[1-9]\d{{0,2}}(?:{re.escape(sign)}\d{{3}})+)"
        rf"(?P<rest>{re.escape(decimal)}\d*)?"
    )
    for decimal in ".,"
    for sign in _GROUP_SIGNS[decimal]
}
_ONE_GROUP: Final = re.compile(r"[-+]?[1-9]\d{0,2}[.,]\d{3}")
DATE: Final = r"\d{1,4}[-./ ](?:\d{1,2}|[A-Za-z]{3,9})[-./ ]\d{1,4}"
CLOCK: Final = re.compile(
    rf"(?:(?P<date>{DATE}),?[ T]+)?"
    r"(?P<hour>\d{1,2}):(?P<minute>\d{2}):(?P<second>\d{2})(?:[.,](?P<part>\d{1,12})|:(?P<ms>\d{3}))?"
    r"(?:\s*(?P<half>[AaPp])\.?[Mm]\.?)?(?:\s*(?:Z|UTC|(?P<ahead>[+-])(?P<zone_h>\d{2})(?::?(?P<zone_min>\d{2}))?))?"
)
_BASIC: Final = re.compile(r"(\d{4})(\d{2})(\d{2})T(\d{2})(\d{2})(\d{2})(?=$|[.,Z+-])")
"""ISO 8601 without signs between: 20261025T135959.125."""
MINUTES: Final = re.compile(r"(?P<minute>\d{1,4}):(?P<second>\d{2})[.,](?P<part>\d{1,12})")
"""As spreadsheets show a time, mm:ss.0; without a fraction it may be hours and minutes."""
HOUR_S: Final = 3600.0


class DateAndTime(NamedTuple):
    """A time as on a clock.

    Attributes:
        date: as it is written; empty without one.
        time_s: since that date's midnight, of UTC where a zone is told, so below 0 or beyond a
            day, too [s].
        has_zone: whether a zone is told by hours.
    """

    date: str
    time_s: float
    has_zone: bool

    @property
    def time_of_day_s(self) -> float:
        """Since midnight, of UTC where a zone is told [s]."""
        return self.time_s % DAY_S if self.has_zone else self.time_s


def number(cell: str, decimal: str, *, decimal_is_sure: bool = False) -> float | None:
    """Return the number in a cell, NaN for one that says there is none, None for other text.

    Signs between thousands are taken out where they can be nothing else: "1,234.5", "1.234.567",
    "1'234".

    Args:
        cell: the text.
        decimal: "." or ",".
        decimal_is_sure: that the user said so: of "1.234" with a decimal comma it is then known
            that the point stands between thousands.
    """
    text = cell.strip()
    if text.lower() in MISSING:
        return math.nan
    text = text.replace(MINUS, "-")
    if any(sign in text for sign in _GROUP_SIGNS[decimal]):
        ungrouped = _without_groups(text, decimal, decimal_is_sure)
        if ungrouped is None:
            return None
        text = ungrouped
    if decimal == ",":
        text = text.replace(",", ".")
    if "_" in text:  # Python's own digit grouping
        return None
    try:
        return float(text)
    except ValueError:
        return None


def _without_groups(text: str, decimal: str, decimal_is_sure: bool) -> str | None:
    """Return a number without the signs between its thousands; None if there may be none."""
    for sign in _GROUP_SIGNS[decimal]:
        found = _GROUPED[decimal, sign].fullmatch(text)
        if found is None:
            continue
        is_sure = (
            sign in _PLAIN_GROUP_SIGNS
            or found["rest"] is not None
            or found["whole"].count(sign) > 1
            or decimal_is_sure
        )
        return found["whole"].replace(sign, "") + (found["rest"] or "") if is_sure else None
    return None


def has_groups(cell: str, decimal: str) -> bool:
    """Whether a cell holds a number with signs between its thousands; see number()."""
    text = cell.strip().replace(MINUS, "-")
    return any(sign in text for sign in _GROUP_SIGNS[decimal]) and (
        _without_groups(text, decimal, True) is not None
    )


def shows_decimal_sign(cells: Iterable[str], decimal: str) -> bool:
    """Whether a sign in one of these cells cannot stand between thousands: "0.5", "12.25"."""
    return any(decimal in cell and not _ONE_GROUP.fullmatch(cell.strip()) for cell in cells)


def pair_in_doubt(cells: Iterable[str], decimal: str) -> tuple[str, str] | None:
    """Return two cells of a column of which the second may be a number of thousands.

    "998" and then "1.002": the point may stand between thousands, for a column of whole numbers.

    Args:
        cells: of one column.
        decimal: the sign that is taken for the decimal one.
    """
    whole = grouped = ""
    for cell in cells:
        text = cell.strip()
        if text.lstrip("+-").isdigit() and len(text.lstrip("+-")) <= 3:
            whole = text if len(text) >= len(whole) else whole
        elif decimal in text and _ONE_GROUP.fullmatch(text):
            grouped = grouped or text
        elif text.lower() not in MISSING:
            return None
    return (whole, grouped) if whole and grouped else None


def thousands_in_doubt(name: str, pair: tuple[str, str], decimal: str) -> str:
    """Say that numbers may have a sign between their thousands, and what settles it."""
    other = "," if decimal == "." else "."
    return (
        f"{name!r} has {pair[0]} and {pair[1]}: say with --decimal {other} that the sign stands "
        f"between thousands, with --decimal {decimal} that it does not"
    )


def time_of_day(cell: str) -> float | None:
    """Return the seconds since midnight of a time as on a clock, with a date before it or not.

    With a zone (+02:00) since midnight UTC. Of minutes and seconds with a fraction (59:58.125)
    since the full hour, or a timer's start.
    NaN for a cell that says there is none, None for other text.
    """
    found = clock_time(cell)
    return None if found is None else found.time_of_day_s


def clock_time(cell: str) -> DateAndTime | None:
    """Return the time that a cell shows as on a clock, of minutes and seconds too.

    Its time is NaN for a cell that says there is none; None for other text.
    """
    text = cell.strip()
    if text.lower() in MISSING:
        return DateAndTime("", math.nan, False)
    found = MINUTES.fullmatch(text)
    if found is None:
        return date_and_time(text)
    if int(found["second"]) > 60:
        return None
    since_s = 60.0 * int(found["minute"]) + float(f"{found['second']}.{found['part']}")
    return DateAndTime("", since_s, False)


def date_and_time(cell: str) -> DateAndTime | None:
    """Return what stands in a cell with a time as on a clock, None for other text."""
    text = _BASIC.sub(r"\1-\2-\3T\4:\5:\6", cell.strip()) if "T" in cell else cell.strip()
    found = CLOCK.fullmatch(text) if ":" in text else None
    if found is None:
        return None
    hour, minute, second = (int(found[name]) for name in ("hour", "minute", "second"))
    if found["half"]:
        if not 1 <= hour <= 12:
            return None
        hour = hour % 12 + (12 if found["half"] in "Pp" else 0)
    if hour > 23 or minute > 59 or second > 60:
        return None
    part = float(f"0.{found['part']}") if found["part"] else float(found["ms"] or 0) * 1e-3
    since = HOUR_S * hour + 60.0 * minute + second + part
    # summer time that ends within a recording is no step of UTC
    return DateAndTime(found["date"] or "", since - zone_s(found), bool(found["ahead"]))


def zone_s(found: re.Match[str]) -> float:
    """Return by how much the clock that CLOCK found is ahead of UTC [s]; 0 without a zone."""
    if not found["ahead"]:
        return 0.0
    zone = HOUR_S * int(found["zone_h"]) + 60.0 * int(found["zone_min"] or 0)
    return math.copysign(zone, float(f"{found['ahead']}1"))


def clock_period(cells: Iterable[str]) -> float:
    """Return after how long a clock shows the same again [s]: an hour if it shows no hours."""
    texts = (cell.strip() for cell in cells)
    shown = [text for text in texts if text.lower() not in MISSING]
    return HOUR_S if shown and all(map(MINUTES.fullmatch, shown)) else DAY_S
