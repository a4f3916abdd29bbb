"""Options of live runs: arrays of samples, real-time scheduling, the latency bench."""

import argparse
import json
import threading

import numpy as np
import pytest
import yaml

from hc_bringup import bench_latency, machine_wake_ups
from hc_bringup.array_messages import with_array_messages
from hc_bringup.commands.run import ask_for_realtime, wants_page, with_parameters
from hc_bringup.errors import UserError
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_sim_rig.scenario import SCENARIO_FOLDER


def test_all_nodes_take_arrays_where_the_rig_sends_them():
    plan = load_plan(find_config("run"))
    assert with_array_messages(plan) == plan
    plan = with_array_messages(with_parameters(plan, "indenter", {"samples_per_message": 4}))
    assert plan.node("estimator").parameters["input.source"] == "samples"
    topics = plan.node("recorder").parameters["expected_topics"]
    assert topics == ["indenter/samples", "hc/estimates"]
    assert plan.node("estimator").parameters["output.estimates"] == "arrays"
    plan = with_parameters(load_plan(find_config("run")), "estimator", {"output.estimates": "both"})
    plan = with_array_messages(with_parameters(plan, "indenter", {"samples_per_message": 4}))
    assert plan.node("estimator").parameters["output.estimates"] == "both"
    assert plan.node("recorder").parameters["expected_topics"][1] == "hc/estimate"


def test_a_fast_rig_sends_arrays_by_itself(tmp_path):
    slow = load_plan(find_config("run"))
    scenario = yaml.safe_load((SCENARIO_FOLDER / "multisine.yaml").read_text())
    (tmp_path / "fast.yaml").write_text(yaml.safe_dump(scenario | {"rate_hz": 4000.0}))
    fast = with_parameters(slow, "indenter", {"scenario": str(tmp_path / "fast.yaml")})
    plan = with_array_messages(fast)
    assert plan.node("indenter").parameters["samples_per_message"] == 4
    assert plan.node("estimator").parameters["input.source"] == "samples"
    assert plan.node("estimator").parameters["input.maximum_backlog"] == 4000  # a second
    given = with_parameters(fast, "estimator", {"input.maximum_backlog": 300})
    parameters = with_array_messages(given).node("estimator").parameters
    assert parameters["input.maximum_backlog"] == 300
    alone = with_parameters(fast, "indenter", {"samples_per_message": 1})
    assert with_array_messages(alone) == alone
    other = with_parameters(fast, "indenter", {"time": "simulated"})
    assert with_array_messages(other) == other
    nothing = with_parameters(slow, "indenter", {"scenario": str(tmp_path / "none.yaml")})
    assert with_array_messages(nothing) == nothing


@pytest.mark.parametrize("priority", [0, 100, 500, -1])
def test_a_priority_that_is_none_is_told_of_the_option(priority):
    """Regression: "HC_REALTIME is '500'", which the user had not set."""
    with pytest.raises(UserError, match=f"--realtime {priority}: give a priority from 1 to 99"):
        ask_for_realtime(priority, None)


def test_a_program_that_may_look_needs_the_page():
    """Regression: --allow-origin without --dashboard did nothing."""
    options = {"dashboard": None, "headless": True, "json": True, "control": False}
    allowed = argparse.Namespace(**options, allow_origin=["https://app.foxglove.dev"])
    assert wants_page(allowed)
    assert not wants_page(argparse.Namespace(**options, allow_origin=[]))
    assert not wants_page(argparse.Namespace(**vars(allowed) | {"dashboard": False}))


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("run", "--realtime", "100"), "--realtime 100: give a priority from 1 to 99"),
        (("run", "--cpus", "70000"), "processors '70000' are not"),
        (("run", "--cpus", "a,b"), "processors 'a,b' are not a list like 0,2-3"),
        # A browser sends neither a slash nor capitals, and nothing equals *: these let nobody in.
        (("run", "--allow-origin", "*"), "'*' is not an origin: scheme://host"),
        (("run", "--allow-origin", "https://app.foxglove.dev/"), "without a slash or path"),
        (("dashboard", "--allow-origin", "https://App.foxglove.dev"), "in small letters"),
        (("dashboard", "--allow-origin", "http://a\nb"), "is not an origin"),
        (("bench", "latency", "--subscribers", "0"), "--subscribers 0 is not from 1 to 64"),
        (("bench", "latency", "--picture", "no/such/folder.png"), "in a folder that exists"),
        (("bench", "latency", "--realtime", "0"), "--realtime 0: give a priority from 1 to 99"),
    ],
)
def test_what_cannot_be_is_one_line(shell, monkeypatch, words, said):
    monkeypatch.setenv("HC_REALTIME", "")
    monkeypatch.setenv("HC_CPUS", "")
    status, out, err = shell(*words)
    assert (status, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1


def test_real_time_that_is_not_permitted_is_said_before_anything_starts(shell, monkeypatch):
    import os

    def refuse(*_arguments):
        raise PermissionError(1, "no")

    monkeypatch.setenv("HC_REALTIME", "")
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    status, _out, err = shell("run", "--realtime")
    assert status == 2
    assert "Operation not permitted" in err
    assert "CAP_SYS_NICE" in err


def case(rate_hz, subscribers, loaded, seed):
    latencies = np.random.default_rng(seed).lognormal(-8.0, 0.5, 2000)
    return {
        "rate_hz": rate_hz,
        "subscribers": subscribers,
        "loaded": loaded,
        "samples_per_message": 1,
        "samples": 2000,
        "lost": 0,
        "skipped": 0,
        "latency_us": bench_latency._quantiles(latencies),
        "arrival_us": bench_latency._quantiles(latencies),
        "machine_us": bench_latency._quantiles(0.1 * latencies),
        "cpu_percent": {"indenter": 1.0, "estimator": 2.0, "recorder": 3.0},
        "latencies_s": latencies,
    }


def test_table_and_picture_of_the_latencies(tmp_path):
    cases = [case(1000.0, 1, False, 1), case(4000.0, 4, True, 2)]
    table = bench_latency.text_table(cases).splitlines()
    assert len(table) == 4
    assert table[2].startswith("| 1 kHz | 1 | as it is | 2000 | 0 |")
    assert {line.count("|") for line in table} == {12}
    own = [float(cell) for cell in table[2].split("|")[-2].split(",")]
    assert own == sorted(own)
    assert own[-1] == pytest.approx(100.0 * cases[0]["latencies_s"].max() * 1e3, abs=0.5)
    bench_latency.draw(cases, tmp_path / "latency.png")
    assert (tmp_path / "latency.png").stat().st_size > 10_000


def test_a_wake_up_is_as_late_as_the_machine_makes_it(monkeypatch):
    """Deadlines stay where they are: after a stall of five periods five wake-ups are late."""
    now = [100.0]
    asleep = []

    def sleep(seconds):
        asleep.append(seconds)
        now[0] += seconds + (0.0055 if len(asleep) == 10 else 0.0001)

    monkeypatch.setattr(machine_wake_ups.time, "monotonic", lambda: now[0])
    monkeypatch.setattr(machine_wake_ups.time, "sleep", sleep)
    late_s = machine_wake_ups.wake_ups(5000.0, 30, threading.Event())
    assert late_s.shape == (30,)
    stalled = slice(9, 15)
    assert late_s[stalled] == pytest.approx([5.5e-3, 4.5e-3, 3.5e-3, 2.5e-3, 1.5e-3, 0.5e-3])
    assert np.delete(late_s, np.r_[stalled]) == pytest.approx(1e-4)
    closed = threading.Event()
    closed.set()
    assert machine_wake_ups.wake_ups(1000.0, 30, closed).shape == (0,)


@pytest.mark.slow
@pytest.mark.process
def test_latencies_are_measured_beside_the_wake_ups_of_the_machine(command_line):
    words = ("--duration", "2", "--rate", "200", "--subscribers", "1", "--machine", "idle")
    done = command_line.run("bench", "latency", *words, "--json")
    assert done.returncode == 0, done.stderr
    (measured,) = json.loads(done.stdout)["cases"]
    assert measured["lost"] == 0
    assert measured["samples"] >= 300
    own, latency = measured["machine_us"], measured["latency_us"]
    assert 0.0 < own["p50"] < latency["p50"]
    assert own["p50"] <= own["p99"] <= own["p99.9"] <= own["max"]


def test_quantiles_of_nothing_are_none():
    assert np.isnan(list(bench_latency._quantiles(np.empty(0)).values())).all()


@pytest.mark.slow
@pytest.mark.process
def test_a_recording_of_arrays_is_read_like_any_other(command_line, tmp_path):
    """Rig, estimator and recorder with four samples a message; the bag into CSV and estimates."""
    import json

    done = command_line.run(
        *("run", "--headless", "--json", "--duration", "4", "--bag", str(tmp_path / "bag")),
        *("--scenario", "multisine", "--filter", "ukf"),
        *("--param", "indenter.samples_per_message=4", "--param", "output.estimates=both"),
        timeout=110.0,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["estimates"] == summary["samples"] > 2000
    read = command_line.run("estimate", str(tmp_path / "bag"), "--verify", "--json")
    figures = json.loads(read.stdout)
    assert figures["samples"] == summary["samples"]
    assert figures["compared"] == summary["estimates"]
    assert figures["different"] == 0
    csv = tmp_path / "samples.csv"
    done = command_line.run("bag", "convert", str(tmp_path / "bag"), str(csv))
    assert done.returncode == 0, done.stderr
    assert len(csv.read_text().splitlines()) == summary["samples"] + 1


@pytest.mark.slow
@pytest.mark.process
def test_the_latency_bench_measures_a_short_case(command_line, tmp_path):
    import json

    done = command_line.run(
        *("bench", "latency", "--duration", "3", "--rate", "1000", "--subscribers", "1"),
        *("--machine", "loaded", "--filter", "ukf", "--json"),
        *("--picture", str(tmp_path / "latency.png")),
        timeout=110.0,
    )
    assert done.returncode == 0, done.stderr
    [only] = json.loads(done.stdout)["cases"]
    assert only["samples"] > 1000
    assert 0.0 < only["latency_us"]["p50"] <= only["latency_us"]["p99"]
    assert (tmp_path / "latency.png").is_file()
