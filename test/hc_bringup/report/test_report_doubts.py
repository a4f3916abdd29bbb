"""What of a recording's readings cannot be right stands in its report, in what is made of it, too.

Of a force with the wrong sign a report said "the force comes 60 ms before the displacement", of a
drag between sensor and tissue that the law does not fit; neither named the cause, as `hc estimate`
does. `hc contacts` and `hc compare` wrote K of 0.03 to 0.3 N/mm with a drag, and no line.
"""

import numpy as np
import pytest

from hc_bringup import cli

RATE = 500.0


@pytest.fixture
def press(tmp_path):
    """Write presses from the air on K = 0.4, n = 1.5, with `change` made to force and speed."""

    def write(change):
        time_s = np.arange(0.0, 24.0, 1.0 / RATE)
        depth = -3.0 + 3.5 * (1.0 - np.cos(np.pi * time_s + 0.8 * np.sin(0.8 * time_s)))
        speed = np.gradient(depth, time_s)
        law = (0.4 + 0.012 * np.sign(speed) * np.abs(speed)) * np.maximum(depth, 0.0) ** 1.5
        noise = np.random.default_rng(1).standard_normal((2, time_s.size))
        force = change(np.maximum(law, 0.0), speed) + 0.01 * noise[0]
        path = tmp_path / "press.csv"
        rows = np.column_stack([time_s, depth + 0.003 * noise[1], force])
        header = "time_s,displacement_mm,force_N"
        np.savetxt(path, rows, delimiter=",", header=header, comments="", fmt="%.6f")
        return str(path)

    return write


def words_of(page):
    text = page.read_text(encoding="utf-8")
    begin = text.index("In words</h2>")
    return text[begin : text.index("</section>", begin)]


def test_a_wrong_sign_is_the_one_thing_said(press, tmp_path, capsys):
    path, page = press(lambda force, _speed: -force), tmp_path / "page.html"
    assert cli.main(["report", path, "-o", str(page)]) == 0
    assert "it reads a push as a pull; turn its sign (force.sign)" in capsys.readouterr().err
    words = words_of(page)
    assert words.count("<li") == 2
    assert "It reads a push" not in words
    assert "it reads a push as a pull; turn its sign (force.sign)." in words
    assert "These are not the parameters of the tissue, for the sign of a channel" in words


def test_a_drag_is_named_and_no_delay_made_of_it(press, tmp_path, capsys):
    path, page = press(lambda force, speed: force + 0.01 * speed), tmp_path / "page.html"
    assert cli.main(["report", path, "-o", str(page)]) == 0
    drag = "ree of contact the force follows the speed"
    assert drag in capsys.readouterr().err
    assert drag in words_of(page)
    assert "ms behind" not in words_of(page)
    assert "ms ahead" not in words_of(page)
    for command in (["contacts"], ["compare", "--filter", "ekf", "--filter", "ukf"]):
        target = tmp_path / ("c.csv" if command == ["contacts"] else "c.html")
        assert cli.main([command[0], path, *command[1:], "-o", str(target)]) == 0
        assert drag in capsys.readouterr().err


def test_sound_readings_are_doubted_nowhere(press, tmp_path, capsys):
    path, page = press(lambda force, _speed: force), tmp_path / "page.html"
    assert cli.main(["report", path, "-o", str(page)]) == 0
    assert capsys.readouterr().err == ""
    assert "is-bad" not in words_of(page)
