"""Types by name: those of message packages, and no code of anything else."""

import sys

import pytest

from hc_msgs_py.interface_class import UnknownInterfaceError, interface_class


def test_types_are_found_with_or_without_their_middle() -> None:
    from std_msgs.msg import Header
    from std_srvs.srv import Trigger

    assert interface_class("std_msgs/msg/Header") is interface_class("std_msgs/Header") is Header
    assert interface_class("std_srvs/Trigger", "srv") is Trigger


@pytest.mark.parametrize(
    "name",
    ["this/msg/X", "antigravity/msg/X", "os.path/msg/X", "../msg/X", ".x/msg/Y", "__main__/X"],
)
def test_a_name_runs_no_code(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Regression: a bag, or anybody in the domain, could have any module imported."""
    before = set(sys.modules)
    with pytest.raises(UnknownInterfaceError):
        interface_class(name)
    assert {"this", "antigravity"} & (set(sys.modules) - before) == set()
    assert capsys.readouterr() == ("", "")
