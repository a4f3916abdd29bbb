"""Which nodes of a run a `--param [NODE.]NAME=VALUE` is for.

Without a node it is for every estimator, whose own names have dots as well: a node that the run
has not, or that is misspelt, must not pass for the first part of such a name.
"""

from __future__ import annotations

import difflib

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.plan import RunPlan
from hc_msgs_py import topics

_KINDS = tuple(value for name, value in vars(topics).items() if name.startswith("NODE_"))


def targets(text: str, plan: RunPlan) -> tuple[list[str], str]:
    """Return the names of the nodes and of their parameter.

    Args:
        text: what stands before the sign of equality.
        plan: the run's.

    Raises:
        UserError: if the run has no such node.
    """
    names = [node.name for node in plan.nodes]
    node, separator, name = text.partition(".")
    if separator and node in names:
        return [node], name
    if separator and plan.of_kind(node):  # each in a namespace
        return [one.name for one in plan.of_kind(node)], name
    starts = UserError(f"--param {text}: the configuration starts {', '.join(names)}", WRONG_USE)
    if separator:
        close = difflib.get_close_matches(node, names, n=1, cutoff=0.7)
        if close:
            raise UserError(f"--param {text}: did you mean {close[0]}.{name}?", WRONG_USE)
        if node.rpartition("/")[2] in _KINDS:
            raise starts
    estimators = [one.name for one in plan.of_kind("estimator")]
    if not estimators:
        raise starts
    return estimators, text
