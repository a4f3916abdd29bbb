"""The hc command: help, wrong use, error lines, exit statuses, nothing overwritten."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hc_bringup.cli import COMMANDS, main
from hc_bringup.estimate_table import COLUMNS
from hc_msgs_py.interface_class import interface_class


def run(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str, str]:
    """Run hc in this process; return status, standard output, standard error."""
    try:
        status = main(words)
    except SystemExit as end:
        status = int(end.code or 0)
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def one_line(text: str) -> bool:
    return text.count("\n") == 1 and text.endswith("\n") and "Traceback" not in text


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    """Two seconds of contact at 500 Hz with noise."""
    time = np.arange(1000) / 500.0
    displacement = 3.0 + 1.5 * np.sin(2 * np.pi * 1.3 * time)
    velocity = 1.5 * 2 * np.pi * 1.3 * np.cos(2 * np.pi * 1.3 * time)
    force = 0.4 * displacement**1.6 * (1.0 + 0.05 * velocity)  # which never pulls
    noise = np.random.default_rng(1).normal(0.0, 0.01, len(time))
    path = tmp_path / "recording.csv"
    rows = np.column_stack([time, displacement, force + noise])
    np.savetxt(
        path, rows, delimiter=",", header="time_s,displacement_mm,force_N", comments="", fmt="%.9f"
    )
    return path


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help(capsys: pytest.CaptureFixture[str], command: str) -> None:
    status, out, _ = run(capsys, command, "--help")
    assert status == 0
    assert f"hc {command}" in out


def test_help_needs_neither_ros_nor_numba() -> None:
    script = (
        "import sys\nfrom hc_bringup.cli import main\n"
        "try:\n    main(['--help'])\nexcept SystemExit:\n    pass\n"
        "assert not {'rclpy', 'numba', 'numpy', 'rich'} & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", script], check=True, stdout=subprocess.DEVNULL)


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["nonsense"], "invalid choice"),
        ([], "required"),
        (["estimate"], "required"),
        (["estimate", "no.csv"], "no.csv does not exist"),
        (["estimate", "no.csv", "--param", "x"], "name=value"),
        (["run", "--duration", "-3"], "seconds >= 0"),
        (["run", "--duration", "soon"], "seconds >= 0"),
        (["run", "no-such-config"], "no configuration 'no-such-config'; give a YAML file, or one"),
        (["run", "robots/fraka"], "no configuration 'robots/fraka'; did you mean robots/franka?"),
        (["replay", "no-bag"], "no-bag does not exist"),
        (["replay", "x.csv", "--rate", "0"], "a number > 0"),
        (["bag", "info", "no-bag"], "no-bag does not exist"),
        (["simulate", "no-scenario", "-o", "x.csv"], "no-scenario"),
        (["simulate", "palpaton_scan", "-o", "x.csv"], "(did you mean palpation_scan?)"),
        (["simulate", "multisine"], "with -o"),
        (["simulate", "-o", "x.csv"], "name a scenario"),
        (["contacts", "x.csv", "--depth", "2", "-o", "y.csv"], "--depth is of the map"),
        (["doctor", "x.csv", "--node", "a"], "--node is for a running set-up"),
        (["doctor", "x.csv", "--seconds", "5"], "--seconds is for a running set-up"),
        (["doctor", "--rate", "500"], "--rate is for a CSV file"),
        (["payload", "--seconds", "3"], "--seconds is for --yes"),
        (["run", "--no-dashboard", "--control"], "leave --no-dashboard away"),
        (["simulate", "multisine", "-o", "x.csv", "--seed", "9223372036854775808"], "larger than"),
        (["simulate", "multisine", "-o", "x.csv", "--seed", "1e30"], "larger than"),
        (["param", "get", "estimator"], "required"),
        (["record", "--nonsense"], "hc record: unrecognized arguments: --nonsense (see hc record "),
    ],
)
def test_wrong_use_is_told_in_one_line(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    words: list[str],
    expected: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    status, out, err = run(capsys, *words)
    assert status in (1, 2)
    assert out == ""
    assert one_line(err)
    assert expected in err
    assert list(tmp_path.iterdir()) == []


def test_estimate_prints_the_summary_of_the_design_as_json(
    capsys: pytest.CaptureFixture[str], recording: Path
) -> None:
    status, out, err = run(capsys, "estimate", str(recording), "--json")
    assert status == 0
    assert err == ""
    summary = json.loads(out)
    for key in (
        "samples",
        "used",
        "rejected",
        "filter",
        "state_space",
        "parameters",
        "parameters_std",
        "channel_delay",
        "channel_delay_std",
        "force_predicted_rmse_n",
        "force_reconstructed_rmse_n",
        "nis_mean",
        "microseconds_per_step",
    ):
        assert key in summary
    assert summary["samples"] == summary["used"] == 1000
    assert summary["parameters"]["stiffness"] == pytest.approx(0.4, rel=0.1)


def test_estimate_takes_a_delay_of_the_force_or_finds_it(
    capsys: pytest.CaptureFixture[str], recording: Path
) -> None:
    def summary(*words: str) -> Any:
        options = (word for text in words for word in ("--param", text))
        status, out, err = run(capsys, "estimate", str(recording), "--json", *options)
        assert status == 0, err
        return json.loads(out)

    given = summary("channel_delay=0.02")
    assert (given["channel_delay"], given["channel_delay_std"]) == (0.02, 0.0)
    found = summary("channel_delay=auto")
    assert found["channel_delay"] == pytest.approx(0.0, abs=0.002)
    assert found["parameters"] == summary()["parameters"]
    status, _, err = run(capsys, "estimate", str(recording), "--param", "channel_delay=soon")
    assert status == 2
    assert one_line(err)
    assert "channel_delay = 'soon' is not 'auto' or a number from -0.06 to 0.06 s" in err


def test_estimate_writes_the_columns_of_the_design_and_never_overwrites(
    capsys: pytest.CaptureFixture[str], recording: Path, tmp_path: Path
) -> None:
    target = tmp_path / "out.csv"
    assert run(capsys, "estimate", str(recording), "-o", str(target))[0] == 0
    lines = target.read_text().splitlines()
    assert lines[0] == COLUMNS
    assert len(lines) == 1001
    assert all(line.count(",") == COLUMNS.count(",") for line in lines)
    for name in ("stiffness [N/mm^n]", "damping_std [N(s/mm)^p/mm^n]"):
        assert name in lines[0].split(",")
    # It is a recording, too: what was estimated from the one is estimated from the other.
    again = json.loads(run(capsys, "estimate", str(target), "--json")[1])
    first = json.loads(run(capsys, "estimate", str(recording), "--json")[1])
    assert again["parameters"] == first["parameters"]
    before = target.read_bytes()
    status, _, err = run(capsys, "estimate", str(recording), "-o", str(target))
    assert status == 2
    assert one_line(err)
    assert "exists already" in err
    assert target.read_bytes() == before


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--filter", "magic"], "'magic'"),
        (["--state-space", "magic"], "'magic'"),
        (["--contact-model", "magic"], "'magic'"),
        (["--param", "magic=1"], "magic"),
        (["--param", "initial_stiffness=-1"], "initial_stiffness"),
        (["--param", "initial_stiffness=word"], "initial_stiffness"),
        (["--param", "filter=ukf"], "option of its own"),
        (["--param", "initial_stiffness=1", "--param", "initial_stiffness=2"], "given twice"),
        (["--input", "force.zero=1", "--input", "force.zero=2"], "given twice"),
        (["--input", f"force.zero=1{'0' * 400}"], "is not a number"),
        (["--input", "force.zero=.nan"], "is not a number"),
    ],
)
def test_estimate_refuses_wrong_settings_in_one_line(
    capsys: pytest.CaptureFixture[str], recording: Path, words: list[str], expected: str
) -> None:
    status, out, err = run(capsys, "estimate", str(recording), *words)
    assert status == 2
    assert out == ""
    assert one_line(err)
    assert expected in err


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "recording.csv"),
        ("a,b,c\n1,2,3\n", "time_s"),
        ("time_s,displacement_mm,force_N\n", "no rows"),
        ("time_s,displacement_mm,force_N\n0,1,2\n0.1,x,2\n", "line 3"),
        ("time_s,displacement_mm,force_N\n0,1\n", "line 2"),
    ],
)
def test_estimate_refuses_a_broken_csv_in_one_line(
    capsys: pytest.CaptureFixture[str], recording: Path, content: str, expected: str
) -> None:
    recording.write_text(content)
    status, out, err = run(capsys, "estimate", str(recording))
    assert status in (1, 2)
    assert out == ""
    assert one_line(err)
    assert expected in err


def test_bad_rows_are_counted_and_told(capsys: pytest.CaptureFixture[str], recording: Path) -> None:
    lines = recording.read_text().splitlines()
    lines[10] = "0.018,inf,1.0"
    lines[12] = "0.022,nan,1.0"
    lines[20] = lines[19]
    lines[30], lines[31] = lines[31], lines[30]
    recording.write_text("\n".join(lines) + "\n")
    status, out, err = run(capsys, "estimate", str(recording), "--json")
    assert status == 0
    summary = json.loads(out)
    assert summary["samples"] == 1000
    assert summary["rejected"]["not_finite"] == 1
    assert summary["rejected"]["time_repeated"] == 1
    assert summary["rejected"]["time_backward"] == 1
    assert "1 row with NaN or infinity" in err
    assert "1 row with a force alone: each reading is used at its own stamp" in err


def test_simulated_bag_and_its_csv_give_the_same_estimates(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    bag, csv = tmp_path / "bag", tmp_path / "samples.csv"
    assert run(capsys, "simulate", "multisine", "-o", str(bag), "--duration", "3")[0] == 0
    assert run(capsys, "bag", "convert", str(bag), str(csv))[0] == 0
    summaries = [json.loads(run(capsys, "estimate", str(path), "--json")[1]) for path in (bag, csv)]
    assert summaries[0]["samples"] == 3000
    for name, value in summaries[0]["parameters"].items():
        assert summaries[1]["parameters"][name] == pytest.approx(value, rel=1e-6)


def test_same_seed_same_bytes(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    for name, seed in (("a", "7"), ("b", "7"), ("c", "8")):
        run(
            capsys,
            *("simulate", "multisine", "-o", str(tmp_path / f"{name}.csv")),
            *("--duration", "0.5", "--seed", seed),
        )
    contents = [(tmp_path / f"{name}.csv").read_bytes() for name in "abc"]
    assert contents[0] == contents[1] != contents[2]


@pytest.mark.parametrize(
    ("words", "option"),
    [
        (("estimate", "a.csv", "--header-lines=--"), "--header-lines"),
        (("estimate", "a.csv", "--units=--"), "--units"),
        (("contacts", "a.csv", "--release=--"), "--release"),
        (("simulate", "multisine", "-o=--"), "-o"),
    ],
)
def test_two_dashes_are_no_value(
    capsys: pytest.CaptureFixture[str], words: tuple[str, ...], option: str
) -> None:
    status, _, said = run(capsys, *words)
    assert status == 2
    assert option in said
    assert "expected one argument" in said
    assert one_line(said)


def test_nothing_is_overwritten(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    target = tmp_path / "bag"
    run(capsys, "simulate", "multisine", "-o", str(target), "--duration", "0.5")
    before = {p.name: p.read_bytes() for p in target.iterdir()}
    source = tmp_path / "samples.csv"
    run(capsys, "bag", "convert", str(target), str(source))
    for words in (
        ("simulate", "multisine", "-o", str(target)),
        ("bag", "convert", str(source), str(target)),
        ("bag", "convert", str(target), str(source)),
        ("run", "--bag", str(target), "--duration", "1"),
        ("replay", str(target), "--bag", str(target)),
    ):
        status, _, err = run(capsys, *words)
        assert status in (1, 2), words
        assert one_line(err)
        assert "exist" in err
    assert {p.name: p.read_bytes() for p in target.iterdir()} == before


def test_a_document_without_a_place_for_the_table_is_refused_before_the_work(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    page = tmp_path / "page.md"
    page.write_text("nothing here")
    for path in (page, tmp_path / "other" / "page.md"):
        status, out, err = run(capsys, "bench", "teleoperation", "--document", str(path))
        assert status == 2
        assert out == ""
        assert one_line(err)
        assert path.name in err


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_bench_teleoperation_prints_rows_alone(capsys: pytest.CaptureFixture[str]) -> None:
    status, out, _ = run(capsys, "bench", "teleoperation", "--quick", "--json")
    assert status == 0
    rows = json.loads(out)["rows"]
    assert {row["method"] for row in rows} == {
        "direct",
        "position_position",
        "wave_variables",
        "model_mediated",
    }
    assert sorted({row["round_trip_ms"] for row in rows}) == [0, 20, 100, 300, 1000]
    assert len(rows) == 20
    verdict = {(row["method"], row["round_trip_ms"]): row["stable"] for row in rows}
    assert not verdict["direct", 300]
    assert all(verdict["model_mediated", delay] for delay in (0, 20, 100, 300, 1000))


def test_the_live_page_without_its_library_says_what_to_install(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("hc_bringup.commands.dashboard.importlib.util.find_spec", lambda _: None)
    status, out, err = run(capsys, "dashboard")
    assert (status, out) == (1, "")
    assert one_line(err)
    assert "pip install hc-suite[dashboard]" in err


@pytest.mark.parametrize(
    ("name", "status", "told"),
    [
        ("Header", 2, "'Header' is not a message type like std_msgs/msg/Header"),
        ("std_msgs/srv/Header", 2, "is not a message type"),
        ("nowhere/msg/A", 1, "message type nowhere/msg/A is not installed here"),
        ("std_msgs/msg/Heder", 1, "type std_msgs/msg/Heder; did you mean std_msgs/msg/Header?"),
        ("std_msgs/msg/Zzz", 1, "there is no message type std_msgs/msg/Zzz"),
    ],
)
def test_a_type_that_is_not_there_is_one_line(
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    name: str,
    status: int,
    told: str,
) -> None:
    def asked(arguments: Any) -> int:
        interface_class(name)
        return 0

    monkeypatch.setattr("hc_bringup.commands.topic.run", asked)
    ended, out, err = run(capsys, "topic", "list")
    assert (ended, out) == (status, "")
    assert one_line(err)
    assert told in err


@pytest.mark.parametrize(
    "words", [["estimate", "INPUT", "--filter", "LONG"], ["run", "--duration", "LONG"], ["LONG"]]
)
def test_a_value_of_thousands_of_characters_does_not_hide_what_is_wrong(
    capsys: pytest.CaptureFixture[str], recording: Path, words: list[str]
) -> None:
    """Regression: it was repeated whole, forty lines of it before the reason."""
    named = {"INPUT": str(recording), "LONG": "v" * 3000}
    try:
        status = main([named.get(word, word) for word in words])
    except SystemExit as ended:
        status = int(ended.code or 0)
    told = " ".join(capsys.readouterr().err.split())
    assert status == 2
    assert len(told) < 600
    assert "characters)...vvv" in told
    assert any(reason in told for reason in ("not one of", "is not seconds", "invalid choice"))


def test_a_long_path_is_told_whole(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = str(tmp_path / ("a" * 120) / ("b" * 100))
    assert main(["estimate", path]) == 1
    assert path in capsys.readouterr().err
