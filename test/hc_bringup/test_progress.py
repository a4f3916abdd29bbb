"""Long work tells how far it is in a file as well, where no bar can be drawn."""

from __future__ import annotations

import pytest

from hc_bringup import heartbeat
from hc_bringup.progress import counted_bar, long_bar, progress_bar, status_line


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """What the heartbeat is given to tell."""
    said: list[str] = []
    monkeypatch.setattr(heartbeat, "telling", lambda _step, text: said.append(text))
    monkeypatch.setattr(heartbeat, "doing", said.append)
    return said


def test_one_count_has_the_time_left(lines: list[str]) -> None:
    with long_bar("results") as tell:
        tell(0, 4)
        tell(1, 4)
        tell(4, 4)
    assert lines[0] == "results: 0 of 4"
    assert [line.split(",")[0] for line in lines[1:]] == ["results: 1 of 4", "results: 4 of 4"]
    assert lines[-1].endswith(", 0 s left")


def test_counts_under_names_have_clocks_of_their_own(
    lines: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Regression: `hc bench accuracy ablation` said nothing for hours where no terminal was."""
    now = [100.0]
    monkeypatch.setattr("time.monotonic", lambda: now[0])
    with counted_bar() as show:
        now[0] += 50.0
        show("tissues", 0, 10)
        now[0] += 20.0
        show("tissues", 2, 10)
        now[0] += 30.0
        show("noise", 0, 4)
        now[0] += 5.0
        show("noise", 1, 4)
    assert lines == [
        "tissues: 0 of 10",
        "tissues: 2 of 10, 80 s left",
        "noise: 0 of 4",
        "noise: 1 of 4, 15 s left",
    ]


def test_shares_and_words(lines: list[str]) -> None:
    with progress_bar("speed") as share:
        share(0.25)
    with status_line() as say:
        say("the recorder")
    assert lines == ["speed: 25 %", "the recorder"]
