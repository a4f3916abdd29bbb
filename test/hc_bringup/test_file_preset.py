"""A preset of how files are written says what the options may, and in one line what it may not."""

import pytest

from hc_bringup.cli import main


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("decimal: ';'", "a point or a comma"),
        ("rate: -5", "a number > 0"),
        ("rate: .inf", "a number > 0"),
        ("rate: .nan", "a number > 0"),
        ("header_lines: -1", "a whole number >= 0"),
        ("find_surface: 'no'", "true or false"),
    ],
)
def test_a_preset_says_what_the_option_may(press_table, tmp_path, capsys, text, says) -> None:
    """Regression: a rate of -5 was one, and find_surface: 'no' looked for it."""
    preset = tmp_path / "preset.yaml"
    preset.write_text(f"{text}\n")
    table = press_table("table.csv", lambda t, d, f: (t, d, f))
    assert main(["estimate", str(table), "--preset", str(preset)]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert says in error
