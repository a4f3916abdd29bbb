"""The dashboard as a node among others: what the page shows is what is on the topics."""

from __future__ import annotations

import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_logger.recording import read_recording

TOKEN = "token-of-the-test"

pytestmark = [pytest.mark.process, pytest.mark.timeout(480)]


@pytest.fixture
def dashboard(command_line: Any) -> Iterator[Callable[..., str]]:
    """Starts a dashboard; returns its address."""
    started: list[subprocess.Popen[str]] = []

    def start(*options: str) -> str:
        command_line.environment["HC_DASHBOARD_TOKEN"] = TOKEN
        process = command_line.start("dashboard", "--port", "0", *options)
        started.append(process)
        line = process.stdout.readline()
        assert line.startswith("live page: "), (line, process.stderr.read())
        return line.removeprefix("live page: ").strip()

    yield start
    for process in started:
        process.send_signal(signal.SIGINT)
        assert process.wait(15) == 0


def until(condition: Callable[[], Any], what: str, timeout_s: float = 60.0) -> Any:
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.1)
    raise AssertionError(f"not within {timeout_s:.0f} s: {what}")


def rows_of(page: Any, names: list[str]) -> Any:
    return np.array(
        page.run(
            "return Array.from({length: HC.app.store.count - HC.app.store.first}, (_, i) => "
            "arguments[0].map((n) => HC.app.store.at(HC.app.store.first + i, n)))",
            names,
        ),
        dtype=float,
    )


@pytest.mark.slow
def test_page_shows_the_bag_that_is_replayed(
    page: Any, dashboard: Callable[..., str], command_line: Any, recorded_bag: Path
) -> None:
    estimates = read_recording(recorded_bag).estimates
    page.open(dashboard())
    page.wait_for("HC.app.state === 'connected'")
    replay = command_line.start("replay", str(recorded_bag))
    last = int(estimates["sequence"][-1])
    until(lambda: page.run("return HC.app.store.last('sequence')") == last, "the end of the bag")
    names = {
        "K": ("stiffness", 1.0),
        "B_std": ("damping_std", 1.0),
        "n": ("displacement_exponent", 1.0),
        "p": ("velocity_exponent", 1.0),
        "force": ("force_measured", 1.0),
        "predicted": ("force_predicted", 1.0),
        "displacement": ("displacement", 1000.0),
    }
    shown = rows_of(page, ["sequence", *names])
    table = estimates[np.searchsorted(estimates["sequence"], shown[:, 0].astype(np.uint64))]
    np.testing.assert_array_equal(table["sequence"], shown[:, 0])
    for place, (field, factor) in enumerate(names.values(), 1):
        np.testing.assert_array_equal(shown[:, place], table[field] * factor, err_msg=field)
    # From the first one on that was taken, all of them arrived.
    samples, lost = rows_of(page, ["samples", "lost"]).sum(axis=0)
    first = int(np.flatnonzero(estimates["sequence"] == shown[0, 0])[0])
    assert samples >= len(estimates) - first
    assert lost == 0
    assert replay.wait(60) == 0
    # The player has gone: that the data have stopped shows within two seconds.
    page.wait(lambda: page.text("#state") == "stopped", "stopped", 5.0)


@pytest.mark.slow
def test_controls_change_the_estimator_and_the_rig(
    page: Any, dashboard: Callable[..., str], command_line: Any, tmp_path: Path
) -> None:
    page.open(dashboard("--control", "--bags", str(tmp_path / "made")))
    page.wait_for("HC.app.state === 'connected'")
    run = command_line.start("run", "--headless", "--scenario", "palpation_scan")
    page.wait(lambda: page.text("#state") == "in contact", "estimates", 90.0)
    until(lambda: page.run("return HC.app.map && HC.app.map.kind") == "line", "the map", 10.0)

    def ask(**message: Any) -> dict[str, Any]:
        return page.driver.execute_async_script(
            "HC.app.connection.ask(arguments[0]).then(arguments[1])", message
        )

    # The range stands there before one types.
    page.press("c")
    page.wait_for("HC.app.controls.settings.indenter.length > 0")
    page.run(
        "const name = document.getElementById('parameter-name');"
        "name.value = 'input.silence_timeout'; name.dispatchEvent(new Event('input'))"
    )
    assert "0.01 to 3600" in page.text("#parameter-about")
    # A filter chosen from the list is in force at the estimator.
    page.run(
        "const filter = document.getElementById('filter'); filter.value = 'rwstukf';"
        "filter.dispatchEvent(new Event('change'))"
    )
    until(lambda: page.run("return HC.app.status.configuration.filter") == "rwstukf", "the filter")
    got = command_line.run("param", "get", "estimator", "filter")
    assert "rwstukf" in got.stdout
    # All or none: one wrong value, and nothing of it is in force.
    wrong = {"tare.samples": 77, "input.silence_timeout": -1.0}
    answer = ask(op="set", node="estimator", parameters=wrong)
    assert not answer["ok"]
    assert "500" in command_line.run("param", "get", "estimator", "tare.samples").stdout
    answer = ask(op="set", node="indenter", parameters={"stiffness": 0.33})
    assert answer["ok"], answer
    assert "0.33" in command_line.run("param", "get", "indenter", "stiffness").stdout
    assert ask(op="call", node="estimator", service="reset")["message"] == "started afresh"
    # A recording made from the page holds the mark.
    assert ask(op="record", on=True)["ok"]
    until(
        lambda: page.run("return (HC.app.status.nodes.dashboard_recorder || {}).level") == 0,
        "the recorder",
    )
    assert "marked: a test" in ask(op="mark", text="a test")["message"]
    time.sleep(1.0)
    bag = Path(ask(op="record", on=False)["message"].removeprefix("recorded: "))
    text = command_line.run("bag", "info", str(bag)).stdout
    assert "/hc/events" in text
    data = b"".join(path.read_bytes() for path in bag.glob("*.mcap"))
    assert data
    from hc_logger.decoder import decoder
    from hc_logger.foreign import open_bag

    with open_bag(bag) as reader:
        decode = decoder(reader.topics["/hc/events"].definition)
        marks = [decode(m.data) for m in reader.messages({"/hc/events"})]
    assert any(m.kind == 64 and m.reason == "a test" for m in marks)
    page.wait(lambda: "mark: a test" in page.text("#timeline ol"), "the mark in the list")
    # A rig that is stopped shows as stopped within two seconds.
    run.send_signal(signal.SIGINT)
    page.wait(lambda: page.text("#state") == "stopped", "stopped", 10.0)
    since = page.run("return HC.app.status.silent_s")
    assert since < 2.0
    assert run.wait(30) == 0


@pytest.mark.slow
def test_read_only_unless_started_with_control(page: Any, dashboard: Callable[..., str]) -> None:
    page.open(dashboard())
    page.wait_for("HC.app.state === 'connected'")
    for message in ({"op": "set", "parameters": {"filter": "ukf"}}, {"op": "mark"}):
        answer = page.driver.execute_async_script(
            "HC.app.connection.ask(arguments[0]).then(arguments[1])", message
        )
        assert not answer["ok"]
        assert "--control" in answer["message"]


@pytest.mark.slow
def test_a_port_in_use_is_one_line(command_line: Any, dashboard: Callable[..., str]) -> None:
    port = dashboard().split(":")[2].split("/")[0]
    done = command_line.run("dashboard", "--port", port)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "--port" in done.stderr
    for address in ("300.1.1.1", "192.0.2.1"):
        nowhere = command_line.run("dashboard", "--listen", address)
        assert nowhere.returncode == 2
        assert "no such address; give another one to --listen" in nowhere.stderr
    wild = command_line.run("dashboard", "--listen", "0.0.0.0")
    assert wild.returncode == 2
    assert "--name" in wild.stderr
    named = command_line.run("dashboard", "--port", "0", "--name", "host")
    assert named.returncode == 2
    assert "--listen ADDRESS as well" in named.stderr
