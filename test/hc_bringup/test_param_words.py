"""Why a parameter was refused, in a user's words."""

import pytest

from hc_bringup.commands import param


@pytest.mark.parametrize(
    ("reason", "said"),
    [
        (
            "Wrong parameter type, expected 'Type.DOUBLE' got 'Type.STRING'",
            "it takes a number, not a text",
        ),
        (
            "Wrong parameter type, expected 'Parameter.Type.BOOL' got 'Parameter.Type.BYTE_ARRAY'",
            "it takes true or false, not byte_array",
        ),
        ("it is not one of x, y, z", "it is not one of x, y, z"),
    ],
)
def test_types_are_told_in_plain_words(reason, said):
    assert param._plain(reason) == said
