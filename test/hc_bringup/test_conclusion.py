"""A run that fails says where its bag is, and what to do with one that was not closed."""

import pytest

from hc_bringup.conclusion import naming_bag
from hc_bringup.errors import FAILURE, UserError


def said_of(bag, given=None):
    with pytest.raises(UserError) as raised, naming_bag(bag, given):
        raise UserError("node recorder was ended by SIGKILL", FAILURE)
    return str(raised.value).removeprefix("node recorder was ended by SIGKILL")


def test_a_bag_that_was_closed_is_named(tmp_path):
    bag = tmp_path / "rec"
    bag.mkdir()
    (bag / "metadata.yaml").touch()
    assert said_of(bag) == f"; what was recorded is in {bag}"
    assert said_of(bag, "rec").endswith(f"{bag}; take another --bag to try again")


def test_nobody_is_told_to_delete_what_can_be_recovered(tmp_path):
    """Regression of 2026-11-26: "delete it", of 128,373 messages of a recorder that was killed."""
    bag = tmp_path / "rec"
    bag.mkdir()
    whole = f"(not closed: hc bag recover {bag} NEW makes it whole)"
    assert said_of(bag, "rec").endswith(f"in {bag} {whole}; take another --bag to try again")
    assert "delete it" not in said_of(bag)


def test_without_a_bag_nothing_is_added(tmp_path):
    assert said_of(None) == said_of(tmp_path / "none") == ""
