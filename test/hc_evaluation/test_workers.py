"""The engine of batches, benchmarks and experiments: nothing is lost, whatever a process does."""

import math
import os
import subprocess
import sys
from collections.abc import Callable

import pytest

from hc_evaluation.workers import WorkerDiedError, each


def square_but_for_three() -> Callable[[int], int]:
    """Three ends the process, as want of memory does. Made here, so that it travels by value."""

    def square(number: int) -> int:
        import os
        import signal

        if number == 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return number * number

    return square


@pytest.mark.parametrize("workers", [1, 2])
def test_every_task_comes_once_with_its_place(workers: int) -> None:
    found = list(each(math.factorial, range(20), workers))
    assert sorted(found) == [(n, math.factorial(n)) for n in range(20)]


def test_one_process_works_task_by_task() -> None:
    results = each(math.factorial, iter([4, -1]), 1)
    assert next(results) == (0, 24)


@pytest.mark.process
def test_a_task_that_ends_its_process_takes_no_other_with_it() -> None:
    function = square_but_for_three()
    found = dict(each(function, range(8), 2, died=lambda number: -number))
    assert found == {n: -3 if n == 3 else n * n for n in range(8)}
    with pytest.raises(WorkerDiedError, match="while it worked on 3 "):
        list(each(function, range(8), 2))


def test_an_error_of_a_task_is_told_as_it_is() -> None:
    with pytest.raises(ValueError, match="factorial"):
        list(each(math.factorial, [1, -1], 2))


@pytest.mark.process
def test_a_program_that_ends_at_once_says_nothing_of_helpers() -> None:
    """Regression: Ctrl-C in hc bench accuracy was followed by warnings of joblib's."""
    script = (
        "import math, os, sys\n"
        "from hc_evaluation.workers import each\n"
        "for _ in each(math.factorial, range(200), 2):\n"
        "    assert 'PYTHONWARNINGS' in os.environ\n"
        "    os._exit(3)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (3, "")


@pytest.mark.process
def test_the_environment_is_afterwards_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONWARNINGS", "default")
    list(each(math.factorial, range(4), 2))
    assert os.environ["PYTHONWARNINGS"] == "default"
    monkeypatch.delenv("PYTHONWARNINGS")
    results = each(math.factorial, range(4), 2)
    next(results)
    results.close()
    assert "PYTHONWARNINGS" not in os.environ
