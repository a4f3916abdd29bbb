"""A parameter file for another node is said, and no other."""

from __future__ import annotations

from pathlib import Path

import pytest

from hc_msgs_py.parameter_sections import files_for_others


@pytest.mark.parametrize(
    ("text", "is_for_it"),
    [
        ("estimator: {ros__parameters: {a: 1}}", False),
        ("/estimator: {ros__parameters: {a: 1}}", False),
        ("/right/estimator: {ros__parameters: {a: 1}}", False),
        ("/left: {estimator: {ros__parameters: {a: 1}}}", True),
        ("/left/estimator: {ros__parameters: {a: 1}}", True),
        ("/**: {ros__parameters: {a: 1}}", True),
        ("/**/estimator: {ros__parameters: {a: 1}}", True),
        ("/*/estimator: {ros__parameters: {a: 1}}", True),
        ("/*: {ros__parameters: {a: 1}}", False),
        ("{a: {ros__parameters: {}}, /left/estimator: {ros__parameters: {}}}", True),
    ],
)
def test_a_file_without_a_section_for_the_node_is_said(
    tmp_path: Path, text: str, is_for_it: bool
) -> None:
    """Regression: a node in a namespace ran with its defaults, and nobody said why."""
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    words = ["node", "--ros-args", "-r", "__ns:=/left", "--params-file", str(path)]
    lines = files_for_others(words, "/left/estimator")
    assert (lines == []) is is_for_it
    for line in lines:
        assert "has no parameters for /left/estimator, only for /" in line


def test_without_a_file_nothing_is_said() -> None:
    assert files_for_others(["node", "--ros-args", "-p", "a:=1"], "/estimator") == []
