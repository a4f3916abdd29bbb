"""Progress of long work on standard error, shown in a terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that takes the done share, 0 to 1."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _share: None
        return
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(title, total=1.0)
        yield lambda share: progress.update(task, completed=share)


@contextmanager
def counted_bar() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a function that takes a name, what is done and how much there is in all.

    Each name gets a bar of its own.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _name, _done, _total: None
        return
    with Progress(console=console) as progress:
        tasks = {}

        def show(name: str, done: int, total: int) -> None:
            if name not in tasks:
                tasks[name] = progress.add_task(name, total=total)
            progress.update(tasks[name], completed=done, total=total)

        yield show


@contextmanager
def status_line() -> Iterator[Callable[[str], None]]:
    """Yield a function that takes what is being done now, in words."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield lambda _text: None
        return
    with console.status("starting") as status:
        yield lambda text: status.update(text)


@contextmanager
def long_bar(title: str, again_s: float = 30.0) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that takes what is done and how much there is in all.

    A terminal gets a bar with the time that is left; a file gets a line now and then.

    Args:
        title: what is counted.
        again_s: between two lines of a file.
    """
    console = Console(stderr=True)
    start = time.monotonic()
    last = start

    def line(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= again_s and done:
            left = (now - start) * (total - done) / done
            print(f"{title}: {done} of {total}, {left:.0f} s left", file=sys.stderr, flush=True)
            last = now

    if not console.is_terminal:
        yield line
        return
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, speed_estimate_period=300.0) as progress:
        task = progress.add_task(title, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)
