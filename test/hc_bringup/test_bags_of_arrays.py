"""Commands on bags that have but the samples of a tactile array."""

import numpy as np
import pytest
from hc_msgs.msg import TactileSample
from rclpy.serialization import serialize_message

from hc_bringup import cli
from hc_logger.csv_file import CsvReader
from hc_logger.writer import BagWriter

START_NS = 1_700_000_000_000_000_000
READS = "/tactile/sample is of an array of 4 taxels: hc bag convert "


@pytest.fixture
def bag(tmp_path):
    """300 samples of 2 x 2 taxels, of which the fifth has three forces, the sixth nine taxels."""
    path = tmp_path / "bag"
    with BagWriter(path) as writer:
        topic = writer.add_topic("tactile/sample", "hc_msgs/msg/TactileSample")
        for i in range(300):
            depth = [1e-3 * (i + k / 10) for k in range(9 if i == 5 else 4)]
            force = [0.5 * i + k for k in range({4: 3, 5: 9}.get(i, 4))]
            message = TactileSample(sequence=i, columns=2, displacement=depth, force=force)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(
                START_NS + i * 2_000_000, 10**9
            )
            writer.write(topic, START_NS + i * 2_000_000, serialize_message(message))
    return path


def test_a_taxel_becomes_a_table(bag, tmp_path, capsys):
    target = tmp_path / "taxel.csv"
    assert cli.main(["bag", "convert", str(bag), str(target), "--taxel", "3"]) == 0
    assert capsys.readouterr().out == f"299 samples written to {target}\n"
    rows = np.concatenate(list(CsvReader(target).blocks()))
    number = np.delete(np.arange(300), 4)
    expected = np.column_stack([0.002 * number, number + 0.3, 0.5 * number + 3])
    np.testing.assert_allclose(rows, expected, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--taxel", "9"], "has no taxel 9 on /tactile/sample: it has taxels 0 to 8"),
        (["--taxel", "1", "--topic", "other"], "/other is no topic of type hc_msgs/msg/Tactile"),
        (["--topic", "tactile/sample"], f"has no samples of one tool; {READS}"),
        ([], READS),
    ],
)
def test_what_cannot_be_converted_leaves_no_table(bag, tmp_path, capsys, words, said):
    target = tmp_path / "taxel.csv"
    assert cli.main(["bag", "convert", str(bag), str(target), *words]) in (1, 2)
    captured = capsys.readouterr()
    assert said in captured.err
    assert len(captured.err.splitlines()) == 1
    assert not target.exists()


def test_a_taxel_is_of_a_bag_with_an_array(tmp_path, capsys):
    table = tmp_path / "press.csv"
    table.write_text("time_s,displacement_mm,force_N\n0,0,0\n1,1,1\n")
    assert cli.main(["bag", "convert", str(table), str(tmp_path / "bag"), "--taxel", "1"]) == 2
    assert "--taxel is for a bag that becomes CSV" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words", [["estimate"], ["doctor"], ["report", "-o", "x.html"], ["contacts", "-o", "x.csv"]]
)
def test_commands_lead_to_the_table(bag, tmp_path, monkeypatch, capsys, words):
    monkeypatch.chdir(tmp_path)
    assert cli.main([words[0], str(bag), *words[1:]]) == 1
    assert READS in capsys.readouterr().err


def test_verify_says_why_there_is_none_and_what_there_is(bag, capsys):
    """It said what `hc estimate` says, as if the table of a taxel could be verified."""
    assert cli.main(["estimate", str(bag), "--verify"]) == 1
    [said] = capsys.readouterr().err.splitlines()
    assert READS in said
    assert said.endswith(
        "; estimates of an array are not verified, for no bag says with which settings they were "
        "made: hc estimate taxel.csv --filter ukf (or what array_estimator was told) computes one "
        "taxel's anew"
    )


def test_a_batch_says_what_can_be_typed(bag, tmp_path, capsys):
    """It said "hc bag convert the recording taxel.csv"."""
    spaced = bag.rename(tmp_path / "left pad")
    assert cli.main(["batch", str(spaced), "-o", str(tmp_path / "out")]) == 1
    assert "hc bag convert RECORDING taxel.csv --taxel N (0 to 3" in capsys.readouterr().out


def test_a_replay_names_the_node_of_arrays(bag, capsys):
    assert cli.main(["replay", str(bag), "--estimator"]) == 2
    said = capsys.readouterr().err
    assert "is of a tactile array, for the node array_estimator" in said
