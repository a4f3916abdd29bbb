"""The page about the node names everything that the node has, and the messages agree with it."""

from pathlib import Path

import pytest
from hc_msgs.msg import EstimatorConfiguration, EstimatorEvent, HuntCrossleyEstimate

from hc_estimator import Rejection
from hc_estimator.ros.node_settings import CHOICE_NAMES, NODE_SETTINGS
from hc_estimator.stream.vocabulary import Cause, EventKind

PAGE = (Path(__file__).parents[2] / "docs" / "node.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "name", [*CHOICE_NAMES, *NODE_SETTINGS, "~/ready", "~/reset", "~/tare", "~/save", "~/load"]
)
def test_every_parameter_and_service_is_explained(name):
    assert name in PAGE


@pytest.mark.parametrize("kind", EventKind)
def test_every_event_is_explained_and_has_the_number_of_its_message(kind):
    assert kind.name in PAGE
    assert getattr(EstimatorEvent, kind.name) == kind


def test_causes_and_rejections_have_the_numbers_of_their_messages():
    for cause in Cause:
        assert getattr(EstimatorConfiguration, cause.name) == cause
    for reason in Rejection:
        assert getattr(HuntCrossleyEstimate, reason.name) == reason


@pytest.mark.parametrize("setting", NODE_SETTINGS.values(), ids=lambda s: s.name)
def test_every_setting_accepts_its_default_and_says_what_it_is(setting):
    assert setting.checked(setting.default) == setting.default
    assert setting.description.endswith(".") or setting.unit
