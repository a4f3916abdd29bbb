"""Lines of a run without a panel: what is wrong is told once, not once a second."""

from hc_bringup.live import Display
from hc_bringup.monitor import Monitor
from hc_bringup.phrases import left_of, without_numbers
from hc_bringup.run_state import RunState
from hc_bringup.statistics import EstimateStatistics
from hc_estimator.stream.readings import SUSPECT


def test_a_problem_whose_numbers_change_is_told_once(capsys):
    """Regression: a sensor that was dead for a minute gave sixty lines."""
    display = Display(enabled=False)
    shown = RunState(EstimateStatistics(), 0.0)

    def told(**problems):
        shown.problems = problems
        display._tell_problems(shown)
        return capsys.readouterr().err.splitlines()

    silent = "no usable sample for {} s: no message on /wrench from /robot"
    assert told(estimator=silent.format(1.1)) == [f"estimator: {silent.format(1.1)}"]
    assert told(estimator=silent.format(2.1)) == []
    more = f"{silent.format(3.1)}; 2 publishers on /wrench"
    assert told(estimator=more) == [f"estimator: {more}"]
    assert told(estimator=silent.format(4.1)) == []
    assert told(recorder="disk full") == ["recorder: disk full"]
    assert told(recorder="disk full", estimator=silent.format(0.9)) == [
        f"estimator: {silent.format(0.9)}"  # it had been well in between
    ]


def test_phrases_are_compared_without_their_numbers():
    assert without_numbers("near 4 mm; lost 3") == without_numbers("near 3.95 mm; lost 12")
    assert left_of("near 4 mm; lost 3", ["near 3.9 mm"]) == "lost 3"
    assert left_of("near 4 mm", []) == "near 4 mm"


def test_that_no_sample_comes_any_more_is_no_problem_when_the_source_has_ended():
    """Regression: "estimator: no usable sample for 0.6 s" at the end of every fifth replay."""
    state = RunState(EstimateStatistics(), 0.0, problems={"player": "slow"})
    state.add_other("right/estimator", EstimateStatistics())
    said = {"estimator": "no usable sample for 0.6 s", "recorder": "disk full", "player": "slow"}
    said["right/estimator"] = said["estimator"]
    assert state.after_the_source(said) == {"recorder": "disk full", "player": "slow"}
    monitor = Monitor()
    monitor.diagnostics["player"] = {"level": "0", "message": "plays"}
    assert not monitor.has_finished("player")
    monitor.diagnostics["player"]["message"] = "finished"
    assert monitor.has_finished("player")
    assert not monitor.has_finished("indenter")
    state.problems = {"estimator": "no usable sample for 9 s"}  # before it ended already
    assert set(state.after_the_source(said)) == {"estimator", "recorder", "player"}


def test_another_clock_is_told_even_if_one_was_told_before(capsys):
    """Regression: of a driver that came back with stamps as of 1970 nothing was said.

    Its clock had been an hour ahead before, and what was doubted was told once for each check.
    """
    display = Display(enabled=False)
    ahead = "samples are stamped {} s in the future: the clocks of sensor and computer differ"
    shown = RunState(EstimateStatistics(), 0.0)

    def told(doubt, message="estimating"):
        said = {"message": message}
        if doubt:
            said[f"{SUSPECT}clock of samples"] = doubt
        shown.diagnostics["estimator"] = said
        display._tell_problems(shown)
        return capsys.readouterr().err.splitlines()

    assert len(told(ahead.format(3600))) == 1
    assert told(ahead.format(3601)) == []
    assert told("") == []
    assert told("samples are stamped as of 1970")[0].startswith("samples are stamped as of 1970")
    jump = "stamps jumped by +3601.244 s: the estimator was started afresh"
    assert told("", f"{jump}; lost 3") == [jump]
    assert told("", jump) == []
    again = jump.replace("+", "-")
    assert told("", again) == [again]


def test_that_a_node_died_and_is_started_again_is_told_at_once(capsys):
    """Regression: of a run without a panel its summary told that, and nothing before."""
    display = Display(enabled=False)
    shown = RunState(EstimateStatistics(), 0.0, elapsed_s=12.34)
    for expected in (["12.3 s: recorder gone"], []):
        shown.revived = ["recorder gone"]
        display._tell_problems(shown)
        assert capsys.readouterr().err.splitlines() == expected
    shown.revived.append("estimator gone")
    display._tell_problems(shown)
    assert capsys.readouterr().err.splitlines() == ["12.3 s: estimator gone"]
