"""Imported first by every package with nodes: a node that still imports ends by Ctrl-C quietly.

`python -m hc_sim_rig.node` needs seconds until it can answer an interrupt (`node_main`); Python
would answer one before that with a traceback out of whatever is imported just then. Programs that
import the packages keep their own answer.
"""

import signal
import sys


def is_node(arguments: list[str]) -> bool:
    """Whether a command line starts a module that is a node with python -m."""
    if "-m" not in arguments[:-1]:
        return False
    return arguments[arguments.index("-m") + 1].endswith("node")


# Python puts the module's path in the place of -m once its packages are imported.
if sys.argv[:1] == ["-m"] and is_node(sys.orig_argv):
    signal.signal(signal.SIGINT, signal.SIG_DFL)
