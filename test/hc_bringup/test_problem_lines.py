"""Lines of a run without a panel: what is wrong is told once, not once a second."""

from types import SimpleNamespace

from hc_bringup.live import Display
from hc_bringup.phrases import left_of, without_numbers


def test_a_problem_whose_numbers_change_is_told_once(capsys):
    """Regression: a sensor that was dead for a minute gave sixty lines."""
    display = Display(enabled=False)
    shown = SimpleNamespace(problems={}, suspicions={}, others=())

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
