"""Compiles what the nodes need, once, so that the first run does not wait for it.

`./hc` runs this at the end of the installation. The compiled code is kept in numba's cache
beside the sources (or in the user's cache folder where those are not writable).
"""

from __future__ import annotations

from hc_estimator import available_filters, create_estimator
from hc_sim_rig.rig import Rig

DEFAULT_SCENARIO = "multisine"


def main() -> None:
    """Compile all filters, because the node can switch among them, and the rig."""
    for name in available_filters():
        create_estimator(name).warm_up()
    Rig(DEFAULT_SCENARIO).warm_up()


if __name__ == "__main__":
    main()
