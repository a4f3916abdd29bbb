"""Python's warnings in code of others: none of them ends a program of ours.

`PYTHONWARNINGS=error`, as developers have it, made each command that speaks to nodes fail: what
reads the middleware's messages imports a module that Python has deprecated. What Matplotlib logs
where the home takes no file (it then works in a folder of its own) is nothing to do about either.
"""

from __future__ import annotations

import logging
import warnings

OURS = r"(hc_|__main__)"


def ignore_those_of_others() -> None:
    """Leave the warnings of our own modules as Python was told to take them, and no others."""
    warnings.filterwarnings("ignore", module=rf"(?!{OURS})")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
