"""Compiles what the nodes need, once, so that the first run does not wait for it.

`./hc` runs this during the installation, in two processes: one beside the other packages and the
compiler of the messages, which it does without, and one after them. The compiled code is kept in
numba's cache beside the sources (or in the user's cache folder where those are not writable).
"""

from __future__ import annotations

import sys

from hc_estimator import available_filters, create_estimator

AHEAD = ("self_tuning_ukf", "rbpf", "sir_pf")
DEFAULT_SCENARIO = "multisine"
PARTS = ("ahead", "rest")


def main(part: str | None = None) -> None:
    """Compile all filters, because the node can switch among them, and the rig.

    Args:
        part: "ahead" for the filters in `AHEAD`, "rest" for all else, None for everything.

    Raises:
        ValueError: if there is no such part.
    """
    if part not in (None, *PARTS):
        raise ValueError(f"part is one of {', '.join(PARTS)}, not {part!r}")
    for name in available_filters():
        if part is None or (name in AHEAD) == (part == "ahead"):
            create_estimator(name).warm_up()
    if part != "ahead":
        from hc_sim_rig.rig import Rig
        from hc_sim_rig.ros.ahead import RowsEncoder

        Rig(DEFAULT_SCENARIO).warm_up()
        RowsEncoder().warm_up()


if __name__ == "__main__":
    main(*sys.argv[1:])
