"""Worker processes of the experiments: they start clean, and never outlive who started them."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
import time
from concurrent.futures import ProcessPoolExecutor


def prepare_worker(parent: int) -> None:
    """Leave an interruption to the main process, and do not outlive it if it is killed.

    Args:
        parent: id of the main process.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def worker_pool(workers: int) -> ProcessPoolExecutor:
    """A pool of processes.

    They are not forked: compiled code and its threads do not survive that everywhere.

    Args:
        workers: how many.
    """
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(workers, context, prepare_worker, (os.getpid(),))
