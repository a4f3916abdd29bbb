"""PYTHONWARNINGS=error is about our code: a deprecated module in others' ends nothing."""

import warnings

import pytest

from hc_msgs_py.node_processes import Processes
from hc_msgs_py.warnings_of_others import ignore_those_of_others


def warn(module):
    warnings.warn_explicit("old", DeprecationWarning, "file.py", 1, module=module, registry={})


def test_only_warnings_of_others_are_ignored():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ignore_those_of_others()
        warn("lark.utils")
        warn("numpy.lib.thc_")
        for ours in ("hc_estimator.node", "hc_bringup.commands.run", "__main__"):
            with pytest.raises(DeprecationWarning, match="old"):
                warn(ours)


@pytest.mark.process
@pytest.mark.parametrize("words", [("hc_bringup", "node", "list"), ("hc_logger.player_node",)])
def test_commands_and_nodes_begin(words, ros_domain, tmp_path):
    """Regression: "internal error: DeprecationWarning: module 'sre_parse' is deprecated"."""
    processes = Processes(ros_domain, tmp_path, PYTHONWARNINGS="error")
    done = processes.run("-m", *words, timeout_s=60.0)
    assert "DeprecationWarning" not in done.stderr + done.stdout
    assert done.returncode == (0 if words[0] == "hc_bringup" else 2), done.stderr  # no bag given
