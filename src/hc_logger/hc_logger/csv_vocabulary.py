"""What columns and units are called in the CSV files of testing machines and data loggers."""

from __future__ import annotations

import re
from typing import Final

QUANTITIES: Final = ("time", "displacement", "force")
STANDARD_GRAVITY: Final = 9.80665
"""m/s²: what makes a force of a gram."""

UNITS: Final[dict[str, dict[str, float]]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "d": 86_400.0},
    "displacement": {"m": 1e3, "cm": 10.0, "mm": 1.0, "um": 1e-3, "nm": 1e-6, "in": 25.4},
    "force": {
        "N": 1.0,
        "mN": 1e-3,
        "uN": 1e-6,
        "nN": 1e-9,
        "kN": 1e3,
        "gf": STANDARD_GRAVITY * 1e-3,
        "kgf": STANDARD_GRAVITY,
        "lbf": 0.45359237 * STANDARD_GRAVITY,
    },
}
"""Factor of each unit into the core's s, mm, N."""
_WITHOUT_CASE: Final[dict[str | None, dict[str, str]]] = {
    quantity: {u.lower(): u for kind in UNITS for u in UNITS[kind] if quantity in (None, kind)}
    for quantity in (None, *QUANTITIES)
}

_OTHER_SPELLINGS: Final = {
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "sek": "s",
    "sek.": "s",
    "sec.": "s",
    "sekunden": "s",
    "millisekunden": "ms",
    "msec": "ms",
    "millisecond": "ms",
    "milliseconds": "ms",
    "usec": "us",
    "µs": "us",
    "nanosec": "ns",
    "nanosecs": "ns",
    "nanosecond": "ns",
    "nanoseconds": "ns",
    "nsec": "ns",
    "nsecs": "ns",
    "minutes": "min",
    "day": "d",
    "days": "d",
    "tage": "d",
    "metre": "m",
    "meter": "m",
    "metres": "m",
    "meters": "m",
    "millimetre": "mm",
    "millimeter": "mm",
    "millimetres": "mm",
    "millimeters": "mm",
    "µm": "um",
    "micron": "um",
    "microns": "um",
    "mikrometer": "um",
    "nanometre": "nm",
    "nanometer": "nm",
    "µn": "uN",
    "micrometre": "um",
    "micrometer": "um",
    "inch": "in",
    "inches": "in",
    "newton": "N",
    "newtons": "N",
    "millinewton": "mN",
    "millinewtons": "mN",
    "g": "gf",
    "gram": "gf",
    "grams": "gf",
    "gramm": "gf",
    "kg": "kgf",
    "kilogram": "kgf",
    "kilograms": "kgf",
    "kp": "kgf",
    "lb": "lbf",
    "lbs": "lbf",
    "pound": "lbf",
    "pounds": "lbf",
}
_DAY: Final = "d"
"""A displacement elsewhere, and in "position d" what is desired: a unit of nothing but a time."""
_ONLY_AS_FORCE: Final = ("g", "gramm", "kg", "lb", "lbs")
NAMES: Final[dict[str, tuple[str, ...]]] = {
    "time": ("time", "t", "elapsed time", "timestamp", "time stamp", "test time", "zeit",
             "running time", "date time", "datetime", "time of day", "zeitstempel", "uhrzeit",
             "unix time", "time unix", "t unix", "epoch", "epoch time", "stamp", "ros time",
             "prüfzeit", "messzeit", "laufzeit", "temps", "durée", "tiempo", "tempo"),
    "displacement": ("displacement", "disp", "distance", "position", "pos", "depth", "indentation",
                     "indentation depth", "penetration", "penetration depth", "deformation",
                     "compression", "extension", "compressive extension", "crosshead position",
                     "compressive displacement", "travel", "stroke", "crosshead", "d", "z", "weg",
                     "standardweg", "prüfweg", "eindringtiefe", "tiefe", "course",
                     "traversenweg", "eindringung", "déplacement", "enfoncement", "profondeur",
                     "desplazamiento", "spostamento"),
    "force": ("force", "load", "f", "fz", "normal force", "normal load", "contact force",
              "standard force", "compressive force", "compressive load",
              "kraft", "standardkraft", "prüfkraft", "normalkraft", "charge", "effort", "fuerza",
              "forza"),
}  # fmt: skip
"""Names in lower case, without units; the first one is ours."""
NOT_MEASURED: Final = frozenset(
    ("target", "setpoint", "demand", "command", "commanded", "desired", "reference", "sollwert",
     "soll", "error", "limit", "rate", "speed", "velocity", "max", "maximum", "min", "minimum",
     "peak", "mean", "remaining", "number")
)  # fmt: skip
"""Words that say that a column is something else than the reading that the other words name."""

_OF_MESSAGES: Final = (
    (re.compile(r"(?:^|.*[./_])wrench[./_]force[./_](?P<axis>[xyz])$"), "force", "N"),
    (re.compile(r"(?:^|.*[./_])pose[./_]position[./_](?P<axis>[xyz])$"), "displacement", "m"),
    (
        re.compile(r"(?:^|.*[./_])transform[./_]translation[./_](?P<axis>[xyz])$"),
        "displacement",
        "m",
    ),
)
"""Fields of WrenchStamped, PoseStamped and TransformStamped, which are in SI, as exports of bags
name them."""
_IN_BRACKETS: Final = re.compile(r"^(?P<name>.*?)\s*[\[({<]\s*(?P<unit>[^\])}>]*?)\s*[\])}>]\s*$")
_AFTER_SIGN: Final = re.compile(
    r"^(?P<name>.+?)\s*(?:_|/|,|:|\s-\s|\sin\s|\s)\s*(?P<unit>[^\s_/,:]+)$"
)


def unit_of(text: str, quantity: str | None = None) -> str | None:
    """Return the unit that a text names, as UNITS writes it; None if it names none.

    Args:
        text: for example "mm", "[µm]", "Newton".
        quantity: what is measured; None for any.
    """
    bare = text.strip().strip("[](){}<>").strip().replace("\u03bc", "µ")  # the Greek letter mu
    for unit in (bare, _OTHER_SPELLINGS.get(bare.lower(), "")):
        for kind, units in UNITS.items():
            if unit in units and quantity in (None, kind):
                return unit if unit != _DAY or quantity == "time" else None
    # MM or n are no other unit than mm or N; M, MN and Nm (of a torque) are.
    without_case = _WITHOUT_CASE[quantity]
    return without_case.get(bare.lower()) if bare.lower() not in ("m", "mn", "nm", "d") else None


def split_name(cell: str, quantity: str | None = None) -> tuple[str, str | None]:
    """Return the name of a column without its unit, in lower case, and the unit if it has one.

    Args:
        cell: for example "Force [mN]", "force_N", "Kraft in N".
        quantity: what is measured; None for any.
    """
    text = " ".join(cell.split())
    for field, kind, si in _OF_MESSAGES:
        found = field.match(text.lower())
        if found and quantity in (None, kind):
            return f"{kind} {found['axis']}", si
    for pattern in (_IN_BRACKETS, _AFTER_SIGN):
        found = pattern.match(text)
        if found and found["name"]:
            unit = unit_of(found["unit"], quantity)
            if unit == _DAY and _bare(found["name"]) not in NAMES["time"]:
                unit = None
            if unit is not None or pattern is _IN_BRACKETS:
                return _bare(found["name"]), unit
    return _bare(text), None


def is_weight(cell: str) -> bool:
    """Whether a unit is written as a mass, which is then taken for the weight of it."""
    bare = cell.strip().strip("[](){}<>").strip().lower()
    found = _IN_BRACKETS.match(cell) or _AFTER_SIGN.match(cell)
    return bare in _ONLY_AS_FORCE or bool(found and found["unit"].lower() in _ONLY_AS_FORCE)


def _bare(name: str) -> str:
    return " ".join(name.replace("_", " ").lower().split())
