"""Progress of long work on standard error: a bar in a terminal, a line now and then in a file."""

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

from hc_bringup import heartbeat
from hc_bringup.plain_stream import drawing_on


class _Lines:
    """What is done and the time that is left, as the heartbeat's line.

    Args:
        name: of what begins now, if it is known already; its clock runs from here.
    """

    def __init__(self, name: str = "") -> None:
        self._name, self._start = name, time.monotonic()

    def show(self, name: str, done: int, total: int) -> None:
        """Take the present state of what has this name; another name starts the clock anew."""
        now = time.monotonic()
        if name != self._name:
            self._name, self._start = name, now
        left = f", {(now - self._start) * (total - done) / done:.0f} s left" if done else ""
        heartbeat.telling(name, f"{name}: {done} of {total}{left}")


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[float], None]]:
    """Yield a function that takes the done share, 0 to 1."""
    console = Console(file=drawing_on(sys.stderr))
    if not console.is_terminal:
        yield lambda share: heartbeat.telling(title, f"{title}: {100.0 * share:.0f} %")
        heartbeat.nothing()
        return
    heartbeat.nothing()  # the bar tells it
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task(title, total=1.0)
        yield lambda share: progress.update(task, completed=share)


@contextmanager
def counted_bar() -> Iterator[Callable[[str, int, int], None]]:
    """Yield a function that takes a name, what is done and how much there is in all.

    Each name gets a bar of its own in a terminal; a file gets a line now and then.
    """
    console = Console(file=drawing_on(sys.stderr))
    if not console.is_terminal:
        yield _Lines().show
        heartbeat.nothing()
        return
    heartbeat.nothing()  # the bars tell it
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
    console = Console(file=drawing_on(sys.stderr))
    if not console.is_terminal:
        yield heartbeat.doing
        heartbeat.nothing()
        return
    heartbeat.nothing()  # the line that turns tells it
    with console.status("starting") as status:
        yield lambda text: status.update(text)


@contextmanager
def long_bar(title: str) -> Iterator[Callable[[int, int], None]]:
    """Yield a function that takes what is done and how much there is in all.

    A terminal gets a bar with the time that is left; a file gets a line now and then.
    """
    console = Console(file=drawing_on(sys.stderr))
    if not console.is_terminal:
        lines = _Lines(title)
        yield lambda done, total: lines.show(title, done, total)
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
