"""The word that was meant, and a preset by its bare name."""

from hc_bringup.paths import find_config
from hc_msgs_py.nearest import hint


def test_a_near_word_is_named_alone_and_else_all() -> None:
    topics = ["/hc/estimate", "/hc/events", "/indenter/sample"]
    assert hint("/hc/estimat", topics, "topics") == "did you mean /hc/estimate?"
    assert hint("/camera", topics, "topics") == f"topics: {', '.join(topics)}"
    assert hint("/camera", [], "topics") == "topics: none"


def test_a_robots_preset_is_found_by_its_name_alone() -> None:
    assert find_config("franka") == find_config("robots/franka")
    assert find_config("franka").name == "franka.yaml"
