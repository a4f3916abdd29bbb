"""Who does the work of a batch: this process, processes of this machine, or those of a cluster.

joblib on one machine (hc_evaluation/workers.py), Dask distributed beyond. Both give tasks out again
when a process dies; a task that ends every process that tries it becomes a result that says so.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import logging
from collections.abc import Iterable, Iterator
from typing import Any, Final

from hc_bringup.batch.work import Answer, ResultError, Task, WrongSoftwareError, analyse, died
from hc_bringup.errors import UserError
from hc_evaluation.workers import DEATHS, each

PATIENCE_S: Final = 30.0
"""For a scheduler to answer, and for its first worker."""


def here(tasks: Iterable[Task], workers: int) -> Iterator[Answer]:
    """Do tasks on this machine; answers come in any order.

    Args:
        tasks: what is to be done.
        workers: processes; with 1 it is this one.
    """
    for _place, answer in each(analyse, tasks, workers, died):
        yield answer


class SchedulerGoneError(Exception):
    """The scheduler of a cluster does not answer any more."""


@contextlib.contextmanager
def dask_client(scheduler: str | None, workers: int) -> Iterator[Any]:
    """A client of a running scheduler, or of a cluster of this machine that ends with it.

    Args:
        scheduler: address, or None for a cluster of one's own.
        workers: of that.

    Raises:
        UserError: if Dask is not installed, or nobody answers.
    """
    try:
        import dask
        import distributed
    except ImportError as error:
        raise UserError(
            "--scheduler and --local-cluster need Dask: pip install hc-suite[batch] "
            "(or, in a checkout, .venv/bin/python -m pip install 'dask[distributed]')"
        ) from error
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS - 1,
        "distributed.worker.daemon": True,
    }
    logging.disable(logging.CRITICAL)  # what matters we say ourselves, in one line
    with contextlib.ExitStack() as stack:
        stack.callback(logging.disable, logging.NOTSET)
        stack.enter_context(dask.config.set(settings))
        if scheduler is None:
            cluster = distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            )
            stack.enter_context(cluster)
            address: Any = cluster
        else:
            address = scheduler
        try:
            client = stack.enter_context(distributed.Client(address, timeout=PATIENCE_S))
            client.wait_for_workers(1, timeout=PATIENCE_S)
        except TimeoutError as error:
            raise UserError(
                f"{scheduler}: no worker within {PATIENCE_S:.0f} s: start some with "
                f".venv/bin/dask worker {scheduler}"
            ) from error
        except (OSError, ValueError) as error:
            raise UserError(f"there is no Dask scheduler at {scheduler}") from error
        yield client


def distributed_over(tasks: Iterable[Task], client: Any) -> Iterator[Answer]:
    """Do tasks on the workers of a Dask client; answers come in any order.

    No more tasks are with the scheduler than its workers can soon begin.

    Raises:
        SchedulerGoneError: if the scheduler ends or cannot be reached any more.
        UserError: if a worker cannot do such tasks.
    """
    import distributed
    from distributed.comm import CommClosedError

    waiting = iter(tasks)
    given: dict[str, tuple[Any, Task]] = {}
    answers = distributed.as_completed()

    def give(count: int) -> None:
        for task in waiting:
            future = client.submit(analyse, task, pure=False)
            given[future.key] = (future, task)
            answers.add(future)
            count -= 1
            if count <= 0:
                return

    gone = (CommClosedError, concurrent.futures.CancelledError, asyncio.CancelledError, OSError)
    try:
        give(_window(client))
        for future in answers:
            _, task = given.pop(future.key)
            yield _answer(future, task)
            del future
            give(max(1, _window(client) - len(given)))
    except gone as error:
        raise SchedulerGoneError("the scheduler does not answer any more") from error


def _answer(future: Any, task: Task) -> Answer:
    """Return a future's answer.

    Raises:
        UserError: if no worker can do such tasks.
    """
    import distributed
    from distributed.comm import CommClosedError

    try:
        answer: Answer = future.result()
    except distributed.KilledWorker:
        return died(task)
    except (ResultError, WrongSoftwareError, CommClosedError, OSError):
        raise
    except (concurrent.futures.CancelledError, asyncio.CancelledError):
        raise
    except Exception as error:
        raise UserError(
            f"a worker cannot do it: {type(error).__name__}: {error}: start the workers from "
            "the same installation (.venv/bin/dask worker)"
        ) from error
    return answer


def _window(client: Any) -> int:
    return max(16, 4 * int(sum(client.nthreads().values())))
