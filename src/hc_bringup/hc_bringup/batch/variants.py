"""The ways to estimate that a batch compares: every combination of the values that are swept."""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

from hc_bringup.commands.estimate import make_estimator
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import assignment

MOST_VARIANTS: Final = 1000
_OPTIONS: Final = ("filter", "state_space", "contact_model")


@dataclass(frozen=True)
class Variant:
    """One way to estimate.

    Attributes:
        label: how it is called; empty where nothing is swept.
        swept: values by name, of what is swept.
        arguments: options of hc estimate that make its estimator.
        configuration: all that decides its numbers, as plain data.
    """

    label: str
    swept: dict[str, Any]
    arguments: argparse.Namespace
    configuration: dict[str, Any]


def sweep(text: str) -> tuple[str, list[Any]]:
    """Parse NAME=VALUE,VALUE,...; values as in --param.

    Raises:
        argparse.ArgumentTypeError: if it is not of this form.
    """
    name, separator, values = text.partition("=")
    words = [word.strip() for word in values.split(",")]
    if not separator or not name or not all(words):
        raise argparse.ArgumentTypeError(f"{text!r} is not of the form NAME=VALUE,VALUE")
    if len(set(words)) < len(words):
        raise argparse.ArgumentTypeError(f"{text!r} has a value twice")
    name = name.replace("-", "_")
    return name, [assignment(f"{name}={word}")[1] for word in words]


def variants(
    arguments: argparse.Namespace, sweeps: Sequence[tuple[str, list[Any]]]
) -> list[Variant]:
    """Return every combination of the values, each of them possible.

    Args:
        arguments: what hc estimate has: filter, state_space, contact_model and param.
        sweeps: names and values.

    Raises:
        UserError: if a name is given twice, or a combination cannot be.
    """
    names = [name for name, _ in sweeps]
    given = {name for name, _ in arguments.param}
    given |= {name for name in _OPTIONS if getattr(arguments, name) is not None}
    for name in names:
        if names.count(name) > 1 or name in given:
            raise UserError(f"{name} is given twice: once in --sweep {name}=...", WRONG_USE)
    found: list[Variant] = []
    for values in itertools.product(*(values for _, values in sweeps)):
        if len(found) == MOST_VARIANTS:
            raise UserError(f"more than {MOST_VARIANTS} combinations: sweep less", WRONG_USE)
        found.append(_variant(arguments, dict(zip(names, values, strict=True))))
    return found


def _variant(arguments: argparse.Namespace, swept: dict[str, Any]) -> Variant:
    own = argparse.Namespace(**vars(arguments))
    own.param = list(arguments.param)
    for name, value in swept.items():
        if name in _OPTIONS:
            setattr(own, name, str(value))
        else:
            own.param.append((name, value))
    label = " ".join(f"{name}={value}" for name, value in swept.items())
    try:
        estimator = make_estimator(own)
    except UserError as error:
        raise UserError(f"{label}: {error}" if label else str(error), error.status) from error
    configuration = {
        "filter": estimator.filter,
        "state_space": estimator.state_space,
        "contact_model": estimator.contact_model,
        "parameters": estimator.configuration,
    }
    return Variant(label, swept, own, configuration)
