"""What a user says of how a CSV file is written, and whether that can be."""

from __future__ import annotations

import codecs
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from hc_logger.csv_table import SEPARATORS
from hc_logger.csv_vocabulary import UNITS, unit_of
from hc_logger.errors import WrongOptionError

_ASSIGNMENT: Final = re.compile(r"(?:^|,)\s*(time|displacement|force)\s*=", re.ASCII)


@dataclass(frozen=True)
class CsvOptions:
    """What the user says of a file; what is empty is found out.

    Attributes:
        columns: name or number (from 1) of the column of each quantity.
        units: unit of each quantity.
        separator: one character; a space stands for any white space.
        decimal: "." or ",".
        header_lines: how many lines come before the first row of numbers; None finds out.
        encoding: as Python names it.
        rate_hz: rows in a second, of a file that tells no time; 0 reads the time.
    """

    columns: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)
    separator: str = ""
    decimal: str = ""
    header_lines: int | None = None
    encoding: str = ""
    rate_hz: float = 0.0

    def check(self) -> None:
        """See that all can be.

        Raises:
            WrongOptionError: if not; says what can.
        """
        for quantity, unit in self.units.items():
            if unit_of(unit, quantity) is None:
                raise WrongOptionError(
                    f"{unit!r} is no unit of {quantity}: give {', '.join(UNITS[quantity])}"
                )
        if self.separator and self.separator not in SEPARATORS:
            raise WrongOptionError(
                f"{self.separator!r} is no separator: give one of {', '.join(SEPARATORS.values())}"
            )
        if self.decimal not in ("", ".", ","):
            raise WrongOptionError(f"{self.decimal!r} is no decimal sign: give . or ,")
        if self.encoding:
            try:
                text_encoding = codecs.lookup(self.encoding)._is_text_encoding
            except LookupError:
                text_encoding = False
            if not text_encoding:
                raise WrongOptionError(
                    f"{self.encoding[:40]!r} is no encoding: give for example utf-8"
                )
        if self.rate_hz and not (math.isfinite(self.rate_hz) and self.rate_hz > 0.0):
            raise WrongOptionError(f"a rate of {self.rate_hz:g} rows in a second cannot be")
        if self.rate_hz and ("time" in self.columns or "time" in self.units):
            raise WrongOptionError(
                "a rate is for a file that tells no time: say the rate or the time"
            )


def parse_assignments(text: str) -> dict[str, str]:
    """Split "time=A,displacement=B,force=C"; what stands for A may hold commas.

    Raises:
        ValueError: if it is not of that form.
    """
    found = list(_ASSIGNMENT.finditer(text))
    if not found or found[0].start() != 0:
        raise ValueError("it is not of the form time=...,displacement=...,force=...")
    ends = [match.start() for match in found[1:]] + [len(text)]
    result: dict[str, str] = {}
    for match, end in zip(found, ends, strict=True):
        value = text[match.end() : end].strip()
        if not value or match[1] in result:
            raise ValueError(f"{match[1]} is given {'twice' if match[1] in result else 'nothing'}")
        result[match[1]] = value
    return result
