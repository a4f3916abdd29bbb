"""Tasks over the processes of this machine: the engine of batches, benchmarks and experiments.

The processes start clean and never outlive who started them. A process that dies takes nothing
with it: what it had is given out again, and a task that ends every process that tries it is told.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Final, NoReturn, TypeVar

DEATHS: Final = 3
"""Processes that a task may end."""
_NO_WORD: Final = "ignore::UserWarning:joblib.externals.loky.backend.resource_tracker"
"""Joblib's helper tidies up after a program that was interrupted, and would warn its user of it."""

T = TypeVar("T")
R = TypeVar("R")


class WorkerDiedError(RuntimeError):
    """A task ended every process that tried it. One line."""


def prepare_worker(parent: int) -> None:
    """Leave an interruption to the main process, and do not outlive it if it is killed.

    Args:
        parent: id of the main process.
    """
    for number in (signal.SIGINT, signal.SIGHUP):  # a terminal sends them to all of its processes
        signal.signal(number, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _refuse(task: Any) -> NoReturn:
    text = " ".join(str(task).split())[:80]
    raise WorkerDiedError(
        f"the worker process ended while it worked on {text} (not enough memory?)"
    )


def each(
    function: Callable[[T], R],
    tasks: Iterable[T],
    workers: int,
    died: Callable[[T], R] = _refuse,
) -> Iterator[tuple[int, R]]:
    """Do tasks; places of tasks, from 0, and their results come in any order.

    Args:
        function: does a task.
        tasks: what is to be done.
        workers: processes; with 1 it is this one, task by task.
        died: the result of a task that ended DEATHS processes.

    Raises:
        WorkerDiedError: for such a task, unless `died` is given.
    """
    if workers == 1:
        for place, task in enumerate(tasks):
            yield place, function(task)
        return
    left = dict(enumerate(tasks))
    while left:
        begun: list[int] = []
        try:
            with contextlib.closing(_over(function, left, begun, workers)) as results:
                for place, result in results:
                    del left[place]
                    yield place, result
        except BrokenProcessPool:
            # One of those that were begun ended its process: each of them gets one of its own.
            for place in [place for place in begun if place in left]:
                yield place, _alone(function, left.pop(place), died)


def _over(
    function: Callable[[T], R], left: dict[int, T], begun: list[int], workers: int
) -> Generator[tuple[int, R], None, None]:
    from joblib import Parallel, delayed

    def calls() -> Iterator[Any]:
        for place, task in list(left.items()):
            begun.append(place)
            yield delayed(_placed)(function, place, task)

    before = os.environ.get("PYTHONWARNINGS")
    os.environ["PYTHONWARNINGS"] = ",".join(filter(None, (before, _NO_WORD)))
    try:
        yield from Parallel(
            n_jobs=workers,
            return_as="generator_unordered",
            batch_size=1,
            max_nbytes=None,
            initializer=prepare_worker,
            initargs=(os.getpid(),),
        )(calls())
    finally:
        if before is None:
            del os.environ["PYTHONWARNINGS"]
        else:
            os.environ["PYTHONWARNINGS"] = before


def _placed(function: Callable[[T], R], place: int, task: T) -> tuple[int, R]:
    return place, function(task)


def _alone(function: Callable[[T], R], task: T, died: Callable[[T], R]) -> R:
    """Do a task in processes that nothing else depends on."""
    for _ in range(DEATHS - 1):
        try:
            result: R = next(iter(_over(function, {0: task}, [], 2)))[1]  # 1 would be this process
            return result
        except BrokenProcessPool:
            continue
    return died(task)
