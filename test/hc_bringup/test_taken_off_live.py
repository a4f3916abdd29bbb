"""What a node took off the samples of a bag is said where it is not taken off again."""

from argparse import Namespace
from types import SimpleNamespace

import pytest

from hc_bringup.taken_off_live import not_taken_off

PARAMETERS = {
    "input.force.zero": -0.4,
    "input.position.zero": 0.3,
    "input.position.frame_compliance": 0.0,
    "initial_stiffness": 2.0,
}


def said(given=(), *, finds_surface=False, is_bag=True, **parameters):
    configuration = SimpleNamespace(parameters=PARAMETERS | parameters)
    older = SimpleNamespace(parameters={"input.force.zero": 7.0})
    recording = SimpleNamespace(is_bag=is_bag, configurations=[older, configuration])
    return not_taken_off(recording, Namespace(sensors=list(given), find_surface=finds_surface))


def test_zeros_that_nobody_takes_off_are_said_with_the_options_that_do():
    """Regression: K, B, n, p were of other readings than in the run, and nothing was said."""
    assert said() == (
        "its estimator took off force.zero=-0.4, position.zero=0.3: to read it so, say "
        "--input force.zero=-0.4 --input position.zero=0.3"
    )
    assert said([("force.zero", 0.0)]).endswith(" say --input position.zero=0.3")
    stiff = {"input.position.frame_compliance": 0.002}
    assert said(finds_surface=True, **stiff).endswith(
        " say --input position.frame_compliance=0.002"
    )
    friction = {"input.force.dry_friction": 0.3, "input.force.presliding": 0.05}
    options = "--input force.dry_friction=0.3 --input force.presliding=0.05"
    assert said(finds_surface=True, **friction).endswith(options)


@pytest.mark.parametrize(
    ("given", "options"),
    [
        ([("force.zero", 1.0), ("position.zero", 2.0)], {}),
        ([("force.topic", "/ft")], {}),
        ([], {"finds_surface": True}),
        ([], {"is_bag": False}),
    ],
)
def test_nothing_is_said_where_nothing_is_missing(given, options):
    assert not said(given, **options)
