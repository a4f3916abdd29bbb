"""A process that waits to take the place of a node: everything imported, nothing of ROS begun.

    python -m hc_bringup.standby MODULE

Most of a node's start is importing its module and loading compiled code. A node that is started
again when it dies has one of these beside it, so that the tissue is watched again within a second.
It calls the module's `prepare`, if it has one, and then waits for one line: the node's arguments as
a JSON list. With them it becomes the node. Where the line does not come, because whoever would send
it has ended, it ends too.
"""

from __future__ import annotations

import gc
import importlib
import json
import os
import signal
import sys
from types import ModuleType


def main() -> int:
    """Wait for the arguments, then be the node; returns its exit status."""
    name = sys.argv[1]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    module = importlib.import_module(name)
    _prepare(module)
    gc.collect()
    gc.freeze()  # what is there now stays: a collection need not look at it
    line = sys.stdin.readline()
    if not line:
        return 0
    nothing = os.open(os.devnull, os.O_RDONLY)
    os.dup2(nothing, 0)
    os.close(nothing)
    sys.argv = [str(module.__file__), *json.loads(line)]
    status: int = module.main()
    return status


def _prepare(module: ModuleType) -> None:
    prepare = getattr(module, "prepare", None)
    if prepare is not None:
        prepare()


if __name__ == "__main__":
    sys.exit(main())
