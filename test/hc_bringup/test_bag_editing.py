"""hc bag filter, merge and split; did you mean; the options of hc run."""

import argparse
import json
from pathlib import Path

import pytest
from rclpy.serialization import serialize_message
from std_msgs.msg import Float64, Int32

from hc_bringup.cli import main
from hc_bringup.commands import run as run_command
from hc_bringup.errors import UserError
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_logger.foreign import open_bag
from hc_logger.writer import BagWriter

START = 10**18
LATCHED = [{"durability": "transient_local", "reliability": "reliable", "depth": 1}]


def make_bag(path: Path, *, begin_s: float = 0.0, names=("/a", "/b"), kind=Float64) -> Path:
    """Ten messages a second for two seconds on each topic, and one setting at the beginning."""
    type_name = f"std_msgs/msg/{kind.__name__}"
    with BagWriter(path, custom_data={"seed": "3", "run": path.name}) as writer:
        numbers = [writer.add_topic(name, type_name) for name in names]
        setting = writer.add_topic("/setting", "std_msgs/msg/Float64", qos_profiles=LATCHED)
        at = START + round(begin_s * 1e9)
        writer.write(setting, at, serialize_message(Float64(data=7.0)))
        for k in range(20):
            for number in numbers:
                value = kind(data=kind().data.__class__(k))
                writer.write(number, at + k * 10**8, serialize_message(value), sequence=k)
    return path


def contents(path: Path) -> list[tuple[str, int, bytes]]:
    with open_bag(path) as bag:
        assert not bag.problems
        return [(m.topic, m.log_time - START, m.data) for m in bag.messages(list(bag.topics))]


def test_a_part_of_a_bag_keeps_bytes_times_and_what_was_latched(tmp_path: Path, capsys) -> None:
    whole = contents(make_bag(tmp_path / "whole"))
    words = ["bag", "filter", str(tmp_path / "whole"), str(tmp_path / "part")]
    assert main([*words, "--topics", "/a", "/set*", "--start", "0.55", "--duration", "0.5"]) == 0
    assert "6 messages written" in capsys.readouterr().out
    part = contents(tmp_path / "part")
    assert part[0] == ("/setting", 550_000_000, whole[0][2] if whole[0][0] == "/setting" else None)
    wanted = [m for m in whole if m[0] == "/a" and 550_000_000 <= m[1] <= 1_050_000_000]
    assert part[1:] == wanted
    with open_bag(tmp_path / "part") as bag:
        assert bag.custom_data["seed"] == "3"
        assert bag.topics["/setting"].qos_profiles[0]["durability"] == "transient_local"


def test_bags_are_merged_in_the_order_of_time(tmp_path: Path) -> None:
    first = make_bag(tmp_path / "first")
    second = make_bag(tmp_path / "second", begin_s=0.05, names=("/b", "/c"))
    assert main(["bag", "merge", str(first), str(second), "-o", str(tmp_path / "all")]) == 0
    merged = contents(tmp_path / "all")
    assert [m[1] for m in merged] == sorted(m[1] for m in merged)
    assert sorted(merged) == sorted(contents(first) + contents(second))
    with open_bag(tmp_path / "all") as bag:  # what both bags say of themselves, and no more
        assert bag.custom_data["seed"] == "3"
        assert "run" not in bag.custom_data


def test_what_recorded_a_bag_is_a_line_for_each_node(tmp_path: Path, capsys) -> None:
    nodes = [{"name": "estimator", "module": "hc_estimator.node", "parameters": {"filter": "ukf"}}]
    for told, shown in (
        (json.dumps(nodes), "Node:      estimator: hc_estimator.node, filter=ukf\n"),
        ("[1]", "configuration: [1]\n"),
        ("by hand", "configuration: by hand\n"),
    ):
        path = tmp_path / f"bag_{len(told)}"
        with BagWriter(path, custom_data={"configuration": told}):
            pass
        assert main(["bag", "info", str(path)]) == 0
        assert shown in capsys.readouterr().out


def test_a_filter_that_leaves_nothing_says_so(tmp_path: Path, capsys) -> None:
    make_bag(tmp_path / "whole")
    words = [str(tmp_path / "whole"), str(tmp_path / "part"), "--topics", "/a"]
    assert main(["bag", "filter", *words, "--start", "0.001", "--duration", "0.0001"]) == 0
    told = capsys.readouterr().out
    assert told.startswith("0 messages written to ")
    assert "none is of these topics and seconds, see hc bag info" in told


def test_seconds_beyond_all_bags_take_the_whole(tmp_path: Path, capsys) -> None:
    """Regression: 1e300 s were an internal error."""
    whole = contents(make_bag(tmp_path / "whole"))
    names = [str(tmp_path / name) for name in ("whole", "part")]
    assert main(["bag", "filter", *names, "--duration", "1e300"]) == 0
    assert main(["bag", "split", *names, "--every", "1e300"]) == 0
    assert contents(tmp_path / "part") == contents(tmp_path / "part_0") == whole


def test_parts_of_a_split_bag_make_up_the_whole(tmp_path: Path, capsys) -> None:
    whole = contents(make_bag(tmp_path / "whole"))
    words = ["bag", "split", str(tmp_path / "whole"), str(tmp_path / "part"), "--every", "0.75"]
    assert main(words) == 0
    parts = [contents(tmp_path / f"part_{i}") for i in range(3)]
    assert capsys.readouterr().out.count(" messages written to ") == 3
    assert parts[0] + parts[1][1:] + parts[2][1:] == whole
    assert [part[0][:2] for part in parts[1:]] == [
        ("/setting", 750_000_000),
        ("/setting", 1500000000),
    ]
    assert main(words) == 2
    assert "part_0 exists already" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["filter", "whole", "part", "--topics", "/no"], "no topic /no; it has: /a, /b"),
        (["filter", "whole", "part", "--topics", "/no*"], "no such topic; it has /a, /b"),
        (["filter", "whole", "part", "--exclude", "/setings"], "did you mean /setting?"),
        (["filter", "whole", "part", "--start", "9"], "is 1.900 s long: nothing is left"),
        (["filter", "whole", "part", "--start", "1e300"], "is 1.900 s long: nothing is left"),
        (["filter", "whole", "whole"], "exists already"),
        (["filter", "whole", "part", "--exclude", "*"], "nothing is left of its topics, /a, /b"),
        (["merge", "whole", "-o", "part"], "give two bags at least"),
        (["merge", "whole", "./whole/", "-o", "part"], "given twice: its messages would be doub"),
        (["merge", "whole", "other", "-o", "all"], "in one bag and std_msgs/msg/Int32 in other"),
        (["split", "none", "part", "--every", "1"], "none"),
        (["split", "whole", "part", "--every", "0"], "'0' is not a number > 0"),
        (
            ["split", "whole", "part", "--every", "1e-6"],
            "would be 1900001 folders, and 1000 are the most: --every 0.002, say",
        ),
        (["split", "whole", "part", "--every", "1.9e-3"], "would be 1001 folders"),
        (["convert", "whole", "part", "--topic", "/a"], "hc bag filter takes some topics of a bag"),
        (["split", "whole", ".", "--every", "1"], ". is no name that parts can have: give one"),
        (["splt", "whole"], "there is no 'splt'; did you mean 'split'?"),
    ],
)
def test_what_is_wrong_with_bags_is_one_line(
    tmp_path: Path, monkeypatch, capsys, words, expected
) -> None:
    monkeypatch.chdir(tmp_path)
    make_bag(Path("whole"))
    make_bag(Path("other"), kind=Int32)
    try:
        status = main(["bag", *words])
    except SystemExit as end:
        status = end.code
    told = capsys.readouterr()
    assert status in (1, 2)
    assert (told.out, told.err.count("\n")) == ("", 1)
    assert expected in told.err
    assert not Path("part").exists()


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["estimte", "x"], "hc: argument COMMAND: there is no 'estimte'; did you mean 'estimate'?"),
        (["run", "--scenarjo", "lump"], "--scenarjo; did you mean --scenario?"),
        (["estimate", "a.csv", "--fliter=ukf"], "did you mean --filter?"),
        (["bag", "filter", "a", "b", "--tart", "3"], "--tart 3; did you mean --start?"),
        (["bag", "split", "a", "b", "--every", "2", "--tart", "3"], "--tart 3 (see hc "),
        (["topic", "pub", "/a", "std_msgs/msg/Bool", "--tiems=3"], "did you mean --times?"),
        (["qqqqqq"], "(choose from "),
    ],
)
def test_did_you_mean(capsys, words, expected) -> None:
    with pytest.raises(SystemExit) as end:
        main(words)
    told = capsys.readouterr().err
    assert end.value.code == 2
    assert told.count("\n") == 1
    assert expected in told


def options(*words: str) -> argparse.Namespace:
    parser = argparse.ArgumentParser()
    run_command.configure(parser)
    return parser.parse_args(words)


def test_a_run_takes_scenario_seed_rate_filter_and_parameters() -> None:
    plan = load_plan(find_config("run"))
    words = "--scenario lump --seed 4 --rate 2 --filter ukf --param initial_stiffness=0.3"
    words += " --param indenter.stiffness=0.4 --param estimator.input.force.zero=1"
    found = run_command.given_parameters(plan, options(*words.split()))
    assert found == {
        "indenter": {
            "scenario": "lump",
            "seed": 4,
            "rate": 2.0,
            "stiffness": 0.4,
            "time": "simulated",
        },
        "estimator": {
            "filter": "ukf",
            "initial_stiffness": 0.3,
            "input.force.zero": 1,
            "use_sim_time": True,
        },
        "recorder": {"use_sim_time": True},
    }


@pytest.mark.parametrize("words", ["--rate 2", "--param indenter.time=lockstep"])
def test_nodes_beside_a_simulated_clock_go_by_it(words) -> None:
    """Regression: "samples are stamped 2.3 s in the future: the clocks differ" at --rate 2."""
    plan = load_plan(find_config("run"))
    found = run_command.given_parameters(plan, options(*words.split()))
    assert found["estimator"] == found["recorder"] == {"use_sim_time": True}
    assert run_command.given_parameters(plan, options("--rate", "1")) == {"indenter": {"rate": 1.0}}


@pytest.mark.parametrize(
    ("config", "words", "expected"),
    [
        ("robot_run", "--seed 3", "--seed given, but the configuration starts no rig"),
        ("robot_run", "--rate 3", "--rate given, but the configuration starts no rig"),
        ("run", "--filter ukf --param filter=ekf", "filter is given twice"),
        ("run", "--param recorder.output=there", "recorder.output: .* is given by --bag DIR"),
        ("run", "--param recorder.custom_data=[a=b]", "a run says there itself"),
    ],
)
def test_options_that_fit_no_node_are_refused(config, words, expected) -> None:
    with pytest.raises(UserError, match=expected):
        run_command.given_parameters(load_plan(find_config(config)), options(*words.split()))


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (("convert", "SOURCE", "TARGET"), "x.csv.gz"),
        (("convert", "SOURCE", "TARGET"), "x.xlsx"),
        (("convert", "SOURCE", "TARGET"), "x.db3"),
        (("filter", "SOURCE", "TARGET"), "x.csv"),
        (("split", "SOURCE", "TARGET", "--every", "1"), "x.txt"),
        (("recover", "SOURCE", "TARGET"), "x.CSV"),
        (("merge", "SOURCE", "SOURCE", "-o", "TARGET"), "x.csv"),
    ],
)
def test_a_name_of_something_else_is_refused(tmp_path, capsys, words, name):
    """Regression: "60 messages written to x.csv.gz", which was a folder with an MCAP file."""
    put = {"SOURCE": str(make_bag(tmp_path / "bag")), "TARGET": str(tmp_path / name)}
    with pytest.raises(SystemExit) as end:
        main(["bag", *(put.get(word, word) for word in words)])
    assert end.value.code == 2
    assert f"{name}' is no name for what is written: give " in capsys.readouterr().err
    assert not (tmp_path / name).exists()


def test_what_a_bag_lacks_to_become_a_table_is_said(tmp_path, capsys):
    bag = make_bag(tmp_path / "bag")
    assert main(["bag", "convert", str(bag), str(tmp_path / "x.csv")]) == 1
    assert "neither a force (geometry_msgs/msg/WrenchStamped) nor" in capsys.readouterr().err
