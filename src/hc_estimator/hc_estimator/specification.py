"""Sets of parameters of an estimator: defaults replaced, given values checked all at once.

What one parameter is stands in hc_msgs_py.specification; the names are repeated here for filters of
other packages.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Mapping

from hc_msgs_py.nearest import hint
from hc_msgs_py.specification import AUTO, Kind, ParameterSpecification, ParameterValue

__all__ = (
    "AUTO",
    "Kind",
    "ParameterSpecification",
    "ParameterValue",
    "checked_values",
    "with_defaults",
)


def with_defaults(
    specifications: Iterable[ParameterSpecification], defaults: Mapping[str, ParameterValue]
) -> tuple[ParameterSpecification, ...]:
    """The same specifications with some defaults replaced.

    Args:
        specifications: the specifications.
        defaults: default by name; names that do not occur are ignored, so that a filter can give
            defaults for parameters of whichever state space it is combined with.

    Returns:
        Specifications in the same order.
    """
    return tuple(
        dataclasses.replace(s, default=s.checked(defaults[s.name])) if s.name in defaults else s
        for s in specifications
    )


def checked_values(
    specifications: Iterable[ParameterSpecification],
    given: Mapping[str, object],
    *,
    runtime_only: bool = False,
) -> dict[str, ParameterValue]:
    """Check a set of values before any of them is used.

    Args:
        specifications: what is allowed.
        given: values by name.
        runtime_only: refuse parameters that are fixed once the estimator exists.

    Returns:
        The given values, each in its parameter's type.

    Raises:
        ValueError: unknown name, wrong type, out of range, or fixed while running.
    """
    by_name = {s.name: s for s in specifications}
    result = {}
    for name, value in given.items():
        if name not in by_name:
            near = hint(name, sorted(by_name), "known")
            raise ValueError(f"parameter {name} = {value!r} is unknown here; {near}")
        specification = by_name[name]
        result[name] = specification.checked(value)
        if runtime_only and not specification.runtime:
            raise ValueError(
                f"parameter {name} = {value!r} cannot change while the estimator runs: "
                f"create a new estimator with it ({specification.allowed})"
            )
    return result
