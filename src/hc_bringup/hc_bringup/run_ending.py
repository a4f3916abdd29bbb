"""The end of `hc run` on the terminal: a picture of what each estimator felt, and what it says."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.console import Console

from hc_bringup.errors import UserError
from hc_bringup.plain_stream import drawing_on
from hc_bringup.run_data import recorded
from hc_bringup.terminal.ending import ending
from hc_logger.errors import BagError
from hc_logger.info import counts
from hc_logger.mixed_estimates import mixture_in
from hc_logger.recording import read_recording


def show_ending(bag: Path, namespaces: Sequence[str] = ("",), *, controlled: bool = False) -> None:
    """Print a picture of what was felt, a sentence about it, and how to look closer.

    Args:
        bag: that of the run.
        namespaces: that each estimator of the run is in, in their order; empty for none.
        controlled: whether the page could change things, as the last line says how to.
    """
    console = Console(file=drawing_on(sys.stdout), highlight=False)
    several = len(namespaces) > 1
    for space in namespaces:
        whose = f"{space}: " if several else ""
        # Of a run of one estimator the bag says where it was.
        closer = _show(console, bag, f"/{space}" if space and several else "", whose)
        if closer:
            hint = "" if several or controlled else "    touch it yourself: hc run --control"
            console.print(f"Look closer: {closer}{hint}", soft_wrap=True, markup=False)


def _show(console: Console, bag: Path, namespace: str, whose: str) -> str:
    """Print the picture of one estimator.

    Args:
        console: to print on.
        bag: that of the run.
        namespace: of the estimator, where the run had several.
        whose: how the lines begin, where the run had several.

    Returns:
        The command that looks closer; empty where there is no picture.
    """
    try:
        recording = read_recording(bag, namespace=namespace)
        data = recorded(recording)
    except (BagError, UserError) as error:
        console.print(f"{whose}no picture of this run: {error}", soft_wrap=True, markup=False)
        return ""
    unordered = int(np.count_nonzero(np.diff(recording.sequence.astype(np.int64)) < 0))
    if not counts(len(recording.sequence), unordered):
        console.print(
            f"{whose}no picture of this run: its bag holds the samples of several publishers, "
            "mixed",
            soft_wrap=True,
            markup=False,
        )
        return ""
    if data is None and (mixture := mixture_in(recording)):
        said = f"{whose}no picture of this run: {mixture}"
        console.print(said, soft_wrap=True, markup=False)
    if data is None or not (data.contact & data.used).any():
        return ""
    console.print()
    for number, line in enumerate(ending(data, console.width)):
        if whose and not number:
            console.print(whose, end="", markup=False)
        console.print(line, soft_wrap=True)
    name = shlex.quote(os.path.relpath(bag))
    closer = f"hc report {name} -o report.html"
    if namespace:
        part = shlex.quote(f"{os.path.relpath(bag)}{namespace.replace('/', '_')}")
        topics = shlex.quote(f"{namespace}/*")
        closer = (
            f"hc bag filter {name} {part} --topics {topics}, then hc report {part} -o {part}.html"
        )
    return closer
