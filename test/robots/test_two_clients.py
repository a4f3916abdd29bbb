"""Two who ask one estimator at once: each hears of its own outcome, and nothing stays changed."""

import threading
import time

import pytest
import yaml

pytestmark = [pytest.mark.process, pytest.mark.slow, pytest.mark.timeout(600)]

SETTINGS = {
    "source": "sensors",
    "force": {"topic": "ft_sensor/wrench", "sign": 1},
    "position": {"type": "pose", "topic": "tool_pose", "sign": -1, "zero": -200.0},
}


def estimator(bench, **settings):
    path = bench.folder / "node.yaml"
    parameters = {"input": SETTINGS} | settings
    path.write_text(yaml.safe_dump({"estimator": {"ros__parameters": parameters}}))
    return bench.start("-m", "hc_estimator.node", "--ros-args", "--params-file", str(path))


def at_once(bench, *commands):
    """Run commands beside each other; returns what became of each."""
    done = [None] * len(commands)

    def run(i, words):
        done[i] = bench.patiently(*words)

    threads = [threading.Thread(target=run, args=(i, words)) for i, words in enumerate(commands)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return done


def test_who_gives_way_is_told_and_nobody_takes_anothers_outcome_for_his(bench):
    bench.robot(rest_s=1e6, lift_mm=0.0)
    estimator(bench, tare={"samples": 2000})
    assert bench.patiently("reset").returncode == 0

    # Two tares: one outcome, told to both.
    for done in at_once(bench, ["tare"], ["tare"]):
        assert done.returncode == 0, done.stderr
        assert "force zero" in done.stdout

    # A search that waits for a press gives way to a tare.
    results = []
    search = threading.Thread(
        target=lambda: results.append(bench.patiently("find-surface", "--timeout", "60"))
    )
    search.start()
    time.sleep(6.0)
    tare = bench.patiently("tare")
    search.join()
    assert tare.returncode == 0, tare.stderr
    assert "contact at" in tare.stdout
    (searched,) = results
    assert searched.returncode == 1
    assert "find_surface given up: tare was asked for" in searched.stderr, searched.stderr


def test_whoever_waits_for_a_node_that_died_is_told_and_waits_no_longer(bench):
    """Regression: without a time limit it waited for ever, for a node that knew nothing of it."""
    bench.robot(rest_s=1e6, lift_mm=0.0)
    node = estimator(bench)
    assert bench.patiently("reset").returncode == 0
    results = []
    search = threading.Thread(target=lambda: results.append(bench.hc("find-surface")))
    search.start()
    time.sleep(8.0)
    node.kill()
    estimator(bench)
    search.join()
    (searched,) = results
    assert searched.returncode == 1
    assert "/estimator ended meanwhile, and what it was to do with it: ask again" in searched.stderr


def test_two_who_force_it_leave_nothing_forced_behind(bench):
    """Regression: the second put back the value that the first had set for a moment."""
    bench.robot(rest_s=1e6, lift_mm=0.0)
    estimator(bench, tare={"samples": 100})
    assert bench.patiently("reset").returncode == 0
    for _ in range(3):
        at_once(bench, ["tare", "--force"], ["tare", "--force"])
    told = bench.hc("param", "get", "estimator", "tare.force", "--hide-type")
    assert told.stdout.strip() == "False", told.stdout
