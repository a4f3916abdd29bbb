"""Compiles what the nodes need, once, so that the first run does not wait for it.

`./hc` runs this at the end of the installation, in two processes: the default filter, which is half
of the work, while the messages are compiled, and the rest after them. The compiled code is kept in
numba's cache beside the sources (or in the user's cache folder where those are not writable).
"""

from __future__ import annotations

import sys

from hc_estimator import available_filters, create_estimator
from hc_sim_rig.rig import Rig

DEFAULT_FILTER = "self_tuning_ukf"
DEFAULT_SCENARIO = "multisine"
PARTS = ("ahead", "rest")


def main(part: str | None = None) -> None:
    """Compile all filters, because the node can switch among them, and the rig.

    Args:
        part: "ahead" for the default filter alone, "rest" for all others, None for everything.

    Raises:
        ValueError: if there is no such part.
    """
    if part not in (None, *PARTS):
        raise ValueError(f"part is one of {', '.join(PARTS)}, not {part!r}")
    if part != "rest":
        create_estimator(DEFAULT_FILTER).warm_up()
    if part == "ahead":
        return
    for name in available_filters():
        if name != DEFAULT_FILTER:
            create_estimator(name).warm_up()
    Rig(DEFAULT_SCENARIO).warm_up()


if __name__ == "__main__":
    main(*sys.argv[1:])
