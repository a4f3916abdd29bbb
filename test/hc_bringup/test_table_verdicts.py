"""What hc estimate and hc doctor say of a table that is not as it should be, and how to mend it."""

import json
import shlex
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.readings import MEANINGS


@pytest.mark.parametrize(
    ("change", "what", "status"),
    [
        (lambda t, d, f: (t, d - 2.0, -f), "sign", 1),
        (lambda t, d, f: (t, d / 1e3, f), "unit", 1),
        (lambda t, d, f: (t, round(d / 0.1) * 0.1, f), "comes in steps of 0.1 mm", 0),
        (lambda t, d, f: (1e3 * t, d, f), "the unit of the times is wrong", 1),
        (lambda t, d, f: (t, d, 0.3), "a channel does not change", 1),
        (lambda t, d, f: (t, d if t < 1.2 else 1.0, f), "a channel does not change", 1),
        (lambda t, d, f: (t, d + 60.0, f), "did not fit in", 1),
    ],
)
def test_parameters_that_are_not_the_tissues_end_with_status_1(
    press_table, tmp_path: Path, capsys, change, what, status
) -> None:
    path = press_table("table.csv", change)
    out = tmp_path / "estimates.csv"
    assert main(["estimate", str(path), "--json", "-o", str(out)]) == status
    told = capsys.readouterr()
    assert len(json.loads(told.out)["suspicions"]) == 1, told.err
    last = told.err.splitlines()[-1] if status else told.err
    assert what in last
    assert f"what each means and what to do: {MEANINGS}" in told.err
    assert ("the parameters of the tissue" in told.err) is (status == 1)
    assert out.exists()


def test_a_law_that_does_not_fit_is_said_and_who_says_more(press_table, capsys) -> None:
    """Channels that are exchanged raise no other doubt."""
    path = press_table("exchanged.csv", lambda t, d, f: (t, f, d))
    assert main(["estimate", str(path)]) == 0
    last = capsys.readouterr().err.splitlines()[-1]
    assert last.startswith(f"{path}: the contact law did not fit in ")
    assert f"hc doctor {path} says what may be wrong" in last


def test_a_recording_of_which_next_to_nothing_can_be_used_gives_no_parameters(
    press_table, capsys
) -> None:
    """Regression: rows from last to first gave K = 0.88 and status 0, of one sample."""
    path = press_table("backward.csv", lambda t, d, f: (-t, d, f))
    assert main(["estimate", str(path)]) == 1
    told = capsys.readouterr()
    assert "K = " not in told.out
    assert "mostly go backward: sort the readings by time" in told.err
    last = told.err.splitlines()[-1]
    assert "1 of the " in last
    assert "time_backward" in last


def test_a_short_press_with_a_small_force_is_told_as_what_it_is(tmp_path: Path, capsys) -> None:
    path = tmp_path / "short.csv"
    rows = "".join(f"{1e-3 * k},{2e-3 * k:.4f},{2e-5 * k:.7f}\n" for k in range(300))
    path.write_text(f"Time [s],Position [mm],Force [N]\n{rows}")
    assert main(["estimate", str(path)]) == 0
    told = capsys.readouterr()
    assert "after the first 0.15 s of contact: force error " in told.out
    assert " 0.0 mN" not in told.out
    assert "read as: the tool moves by 0.592 mm and pushes with up to 0.00595 N" in told.err


def test_doctor_says_that_a_few_rows_are_too_few(tmp_path: Path, capsys) -> None:
    """Regression: "nothing is wrong" of two rows, with forecasts."""
    path = tmp_path / "two.csv"
    path.write_text("time_s,displacement_mm,force_N\n0,1,2\n0.1,1,2\n")
    assert main(["doctor", str(path)]) == 1
    assert "2 readings of the displacement are too few to judge" in capsys.readouterr().out


def test_what_doctor_says_to_type_puts_a_table_right(press_table, capsys) -> None:
    path = press_table("pull.csv", lambda t, d, f: (t, d - 2.0, -f))
    assert main(["doctor", str(path), "--json"]) == 1
    (command,) = json.loads(capsys.readouterr().out)["findings"][0]["type"]
    assert command == f"hc estimate {path} --input force.sign=-1"
    assert main([*command.split()[1:], "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["suspicions"] == []


def test_how_a_recording_was_read_is_no_finding_of_the_doctor(press_table, capsys) -> None:
    names = "Time [ms],Weg [mm],Kraft [N]"
    path = press_table("named.csv", lambda t, d, f: (1e3 * t, d, f), names)
    path.write_text(path.read_text().replace(",", ";"))
    main(["doctor", str(path), "--json"])
    verdict = json.loads(capsys.readouterr().out)
    assert "time is 'Time [ms]' in ms" in verdict["notes"][0]
    assert not any("Time [ms]" in finding["what"] for finding in verdict["findings"])


def test_a_recording_without_an_approach_says_so(tmp_path: Path, capsys) -> None:
    path = tmp_path / "pressed.csv"
    rows = "\n".join(f"{k * 1e-3!r},1.0,2.0" for k in range(500))
    path.write_text("time_s,displacement_mm,force_N\n" + rows + "\n")
    assert main(["estimate", str(path), "--find-surface"]) == 1
    assert "does not go from free motion into contact" in capsys.readouterr().err


def test_a_recording_without_forces_says_so(tmp_path: Path, capsys) -> None:
    path = tmp_path / "alone.csv"
    rows = "\n".join(f"{k * 1e-3!r},{k * 1e-3!r},nan" for k in range(500))
    path.write_text("time_s,displacement_mm,force_N\n" + rows + "\n")
    assert main(["estimate", str(path)]) == 1
    assert "there is no force in any of the 500 samples" in capsys.readouterr().err


def test_what_the_doctor_says_to_type_mends_all_that_was_found_at_once(
    tmp_path: Path, capsys
) -> None:
    """Regression: two signs were two commands, and each alone left the recording wrong."""
    time_s = np.arange(0.0, 12.0, 0.005)
    depth = 1.2 + 2.2 * np.sin(2.1 * time_s - 1.2) + 0.4 * np.sin(13.0 * time_s)
    speed = np.gradient(depth, time_s)
    force = [
        hunt_crossley_force(d, v, 0.5, 0.05, 1.5, 1.0) for d, v in zip(depth, speed, strict=True)
    ]
    rows = zip(time_s, -depth - 7.0, -np.array(force), strict=True)
    path = tmp_path / "pull test.csv"
    path.write_text("t;way;load\n" + "".join(f"{t:.4f};{d:.6f};{f:.6f}\n" for t, d, f in rows))
    said = ("--columns", "time=t,displacement=way,force=load")
    said += ("--units", "time=s,displacement=mm,force=N")
    assert main(["doctor", str(path), *said, "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    command = shlex.split([c for finding in findings for c in finding["type"]][-1])
    assert main([*command[1:], "--json"]) == 0
    parameters = json.loads(capsys.readouterr().out)["parameters"]
    assert parameters["stiffness"] == pytest.approx(0.5, rel=0.05)
    assert parameters["displacement_exponent"] == pytest.approx(1.5, rel=0.05)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (lambda t, d, f: (t, d, -f), "the sign of a channel is wrong"),
        (lambda t, d, f: (t, d / 1e3, f), "the unit of a channel is wrong"),
    ],
)
def test_tables_of_contacts_and_comparisons_say_that_they_are_not_of_the_tissue(
    press_table, tmp_path: Path, capsys, change, why
) -> None:
    """Regression: "12 contacts", "ukf foretells the force best", status 0, and not a word."""
    path = press_table("table.csv", change)
    sound = press_table("sound.csv", lambda t, d, f: (t, d, f))
    contacts, page = tmp_path / "contacts.csv", tmp_path / "page.html"
    both = [str(sound), str(path), "--filter", "ukf", "--filter", "ekf"]
    for words, written in (
        (["contacts", str(path)], contacts),
        (["compare", *both], page),
    ):
        assert main([*words, "-o", str(written)]) == 1
        told = capsys.readouterr()
        assert written.exists()
        assert f"written: {written}" in told.out
        last = f"hc {words[0]}: {path}: these are not the parameters of the tissue, for {why}"
        assert told.err.splitlines()[-1].startswith(last), told.err
        assert f"{path}: what each means and what to do: {MEANINGS}" in told.err
        assert f"{sound}: " not in told.err
    assert main(["contacts", str(sound), "-o", str(tmp_path / "sound_contacts.csv")]) == 0
    assert capsys.readouterr().err == ""
