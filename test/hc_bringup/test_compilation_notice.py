"""Whoever waits for the compiler is told so, and that it goes on, and nobody else is."""

import time
from collections.abc import Callable, Iterator
from typing import Any

import numba
import pytest

from hc_bringup import cli, compilation_notice
from hc_bringup.compilation_notice import NOTICE, CompilationNotice


@pytest.fixture
def listen() -> Iterator[Callable[..., CompilationNotice]]:
    made = []

    def make(after_s: float, again_s: float = 1000.0) -> CompilationNotice:
        made.append(CompilationNotice(after_s, again_s))
        return made[-1]

    yield make
    for notice in made:
        notice.close()


def fresh() -> Any:
    """Return a kernel that is not compiled yet, with one that it calls."""
    inner = numba.njit(lambda x: x * 2.0)
    return numba.njit(lambda x: inner(x) + 1.0)


def test_a_compilation_that_lasts_is_told_once(
    capsys: pytest.CaptureFixture[str], listen: Callable[..., CompilationNotice]
) -> None:
    listen(0.0)
    for _ in range(3):
        assert fresh()(1.0) == 3.0
    assert capsys.readouterr().err == f"{NOTICE}\n"


def test_that_it_goes_on_is_told_again_and_again_until_it_is_over(
    capsys: pytest.CaptureFixture[str], listen: Callable[..., CompilationNotice]
) -> None:
    """Regression: on a busy machine one line stood for ten minutes, and passed for a hang."""
    notice = listen(0.0, 0.02)
    seen = ""
    notice.on_start(None)
    while seen.count("... compiling the filters, since ") < 3:
        seen += capsys.readouterr().err
    assert seen.startswith(f"{NOTICE}\n")
    assert ", 0 functions done\n" in seen
    for _ in range(2):  # functions that it calls
        notice.on_start(None)
        notice.on_end(None)
    while ", 2 functions done\n" not in seen:
        seen += capsys.readouterr().err
    notice.on_end(None)
    time.sleep(0.2)
    capsys.readouterr()
    time.sleep(0.2)
    assert capsys.readouterr().err == ""


def test_a_short_one_and_code_that_is_there_are_not_told(
    capsys: pytest.CaptureFixture[str], listen: Callable[..., CompilationNotice]
) -> None:
    kernel = fresh()
    kernel(1.0)
    listen(0.0)
    kernel(2.0)
    time.sleep(0.1)
    assert capsys.readouterr().err == ""


def test_one_that_is_over_in_time_is_not_told_later(
    capsys: pytest.CaptureFixture[str], listen: Callable[..., CompilationNotice]
) -> None:
    notice = listen(20.0)
    fresh()(1.0)
    assert notice._timer is None
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("command", ["estimate", "setup", "doctor", "report", "simulate", "bench"])
def test_commands_that_run_kernels_listen_and_the_others_need_no_numba_for_it(
    monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    made = []
    monkeypatch.setattr(compilation_notice, "CompilationNotice", lambda: made.append(1))
    for name, expected in ((command, 1), ("completion", 0)):
        made.clear()
        module = cli._module(name)
        monkeypatch.setattr(module, "run", lambda _: 0)
        words = {
            "estimate": ["x.csv"],
            "report": ["x.csv", "-o", "x.html"],
            "simulate": ["lump", "-o", "x.csv"],
        }
        words |= {"bench": ["speed"], "completion": ["bash"]}
        assert cli.main([name, *words.get(name, [])], tell_waiting=True) == 0
        assert len(made) == expected
        assert cli.main([name, *words.get(name, [])]) == 0
        assert len(made) == expected
