"""Compiles what the nodes need, once, so that the first run does not wait for it.

`./hc` runs this during the installation, in two processes: one beside the other packages and the
compiler of the messages, which it does without, and one after them. Each takes the next filter
that neither has begun, so that they end together. The compiled code is kept in numba's cache
beside the sources (or in the user's cache folder where those are not writable).
"""

from __future__ import annotations

import sys
from pathlib import Path

from hc_estimator import available_filters, create_estimator

LONGEST = ("self_tuning_ukf", "rbpf", "sir_pf")
"""The filters that take longest to compile, which one of the processes begins with."""
DEFAULT_SCENARIO = "multisine"
PARTS = ("ahead", "rest")


def main(part: str | None = None, taken: str | None = None) -> None:
    """Compile all filters, because the node can switch among them, and the rig.

    Args:
        part: "ahead" begins with the filters in `LONGEST` and does without the messages, "rest"
            with the rig and all others; None for everything.
        taken: folder where the parts note what each has begun; None: each compiles everything.

    Raises:
        ValueError: if there is no such part.
    """
    if part not in (None, *PARTS):
        raise ValueError(f"part is one of {', '.join(PARTS)}, not {part!r}")
    if part != "ahead":
        from hc_sim_rig.rig import Rig
        from hc_sim_rig.ros.ahead import RowsEncoder

        Rig(DEFAULT_SCENARIO).warm_up()
        RowsEncoder().warm_up()
    others = [name for name in available_filters() if name not in LONGEST]
    for name in [*LONGEST, *reversed(others)] if part == "ahead" else [*others, *LONGEST[::-1]]:
        if taken is None or _take(Path(taken) / name):
            create_estimator(name).warm_up()


def _take(note: Path) -> bool:
    """Note that a filter is compiled here; returns whether nobody did before."""
    try:
        note.touch(exist_ok=False)
    except FileExistsError:
        return False
    return True


if __name__ == "__main__":
    main(*sys.argv[1:])
