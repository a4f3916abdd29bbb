"""One thing that is wrong, and what it costs in K, B, n and p."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hc_bringup.treated_samples import Estimated

SYMBOLS = "KBnp"
DISTURBED_SHARE = 0.05
"""Of the contact: with more of it beyond the law something is wrong."""
BETTER = 0.5
"""Of the share that did not fit before: a cure leaves less, if it does not leave next to none."""
UNKNOWN = "cannot be said, and neither can delay and zeros, until it is put right"
"""What a fault costs that no number puts right."""


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Attributes:
        what: in a sentence.
        settings: input settings that put it right, by name below `input.`; empty if none does.
            CONTACT_STD, FORCE_LIMIT and CHANNEL_DELAY among them are the estimator's own.
        cost: what it changes in K, B, n, p, in words; empty where that is not known.
    """

    what: str
    settings: dict[str, Any] = field(default_factory=dict)
    cost: str = ""


def cost_of(before: Estimated | None, after: Estimated | None, treated: bool) -> str:
    """Say how the parameters change when a fault is put right."""
    if not treated or after is None:
        return ""
    if before is None:
        return "nothing was known; with it " + ", ".join(
            f"{s} = {v:.3g}" for s, v in zip(SYMBOLS, after.parameters, strict=True)
        )
    changes = []
    for symbol, old, new, deviation in zip(
        SYMBOLS, before.parameters, after.parameters, after.deviations, strict=True
    ):
        if abs(new - old) > max(deviation, 0.01 * abs(new)):
            changes.append(f"{symbol} was {old:.3g}, is {new:.3g}")
    return "; ".join(changes) or "little: no parameter changes by more than its deviation"


def fits_worse(before: Estimated | None, after: Estimated | None) -> bool:
    """Whether a change makes the law fit less of the contact: then it puts nothing right."""
    if before is None:
        return False
    return after is None or after.mismatch > before.mismatch + DISTURBED_SHARE


def cures(before: Estimated | None, after: Estimated | None) -> bool:
    """Whether the law fits with something taken off: next to everywhere, or far better."""
    if after is None:
        return False
    return before is None or after.mismatch <= max(DISTURBED_SHARE, BETTER * before.mismatch)
