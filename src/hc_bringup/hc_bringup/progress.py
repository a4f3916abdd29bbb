"""Progress of long work on standard error, shown in a terminal only."""

from __future__ import annotations

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

from hc_bringup import heartbeat


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
def long_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that takes what is done and how much there is in all.

    A terminal gets a bar with the time that is left; a file gets a line now and then.
    """
    console = Console(stderr=True)
    start = time.monotonic()

    def line(done: int, total: int) -> None:
        left = f", {(time.monotonic() - start) * (total - done) / done:.0f} s left" if done else ""
        heartbeat.telling(title, f"{title}: {done} of {total}{left}")

    if not console.is_terminal:
        yield line
        heartbeat.nothing()
        return
    heartbeat.nothing()  # the bar tells it
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
