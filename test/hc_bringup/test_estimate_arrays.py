"""Estimates that travel many in a message are to the bit those that travel one by one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hc_msgs.msg import HuntCrossleyEstimate, HuntCrossleyEstimates
from rclpy.serialization import deserialize_message, serialize_message

from hc_bringup.dashboard.parsing import EstimatesParser, RecordParser
from hc_bringup.dashboard.taps import Arrival
from hc_bringup.statistics import EstimateStatistics, estimate_rows
from hc_estimator import create_estimator
from hc_estimator.ros.estimate_arrays import EstimateArraysEncoder
from hc_estimator.stream.vocabulary import Batch
from hc_logger.convert import csv_to_bag
from hc_logger.csv_file import write_csv
from hc_logger.errors import BagError
from hc_logger.reader import BagReader
from hc_logger.recording import read_recording
from hc_logger.type_names import ESTIMATE_TYPE, ESTIMATES_TYPE
from hc_logger.writer import BagWriter
from hc_msgs_py.estimates_reader import EstimatesReader
from hc_msgs_py.wire_arrays import ArraysDecoder, Samples, encode_estimates

START = 1_700_000_000_999_000_000
SIZES = (4, 4, 1, 7, 4, 30)
COUNT = sum(SIZES)


def told(form: str = "tip") -> tuple[list[bytes], list[bytes]]:
    """Return the same estimates as messages of one each and as arrays of several sizes."""
    time = np.arange(COUNT) * 25e-5
    depth, force = 2.0 + np.sin(40.0 * time), 1.0 + np.sin(40.0 * time)
    force[7], force[9] = np.nan, 1e9
    stamps = START + np.round(time * 1e9).astype(np.int64)
    sequences = np.arange(5, 5 + COUNT, dtype=np.uint64)
    series = create_estimator("ukf", missing_readings=True).run(time, depth, force)
    each: list[bytes] = []
    arrays: list[bytes] = []
    encoder = EstimateArraysEncoder(form)
    begin = 0
    for size in SIZES:
        part = slice(begin, begin + size)
        begin += size
        columns = (stamps[part], sequences[part], depth[part], force[part])
        latency_ns = 300_000
        rows = type(series)(series.values[part])
        now_ns = int(columns[0][-1]) + latency_ns
        each += encode_estimates(rows, Samples(*columns), form, 3, 1e-6, now_ns)
        arrays.append(
            encoder.encode(Batch(*columns), rows.values, 3, size * 1e-6, latency_ns * 1e-9)
        )
    return each, arrays


def arrivals(messages: list[bytes]) -> list[Arrival]:
    return [Arrival(data, 0) for data in messages]


def assert_equal(found: Any, expected: Any) -> None:
    assert found.dtype.names == expected.dtype.names
    for name in expected.dtype.names:
        if name in ("latency", "computation_time"):  # of sums and shares of them
            np.testing.assert_allclose(found[name], expected[name], rtol=1e-9, err_msg=name)
        else:
            np.testing.assert_array_equal(found[name], expected[name], err_msg=name)


@pytest.mark.parametrize("frame", ["", "tip", "indenter_tip"])
def test_arrays_are_messages_to_rclpy_and_hold_every_field(frame: str) -> None:
    each, arrays = told(frame)
    for data in arrays:
        message = deserialize_message(data, HuntCrossleyEstimates)
        assert len(serialize_message(message)) == len(data)
        assert message.header.frame_id == frame
        ArraysDecoder(HuntCrossleyEstimates).decode(data)
    expected, expected_stamps = RecordParser(ESTIMATE_TYPE).parse(arrivals(each))
    parser = EstimatesParser()
    found, stamps = parser.parse(arrivals(arrays))
    assert parser.counts == list(SIZES)
    assert_equal(found, expected)
    np.testing.assert_array_equal(stamps, expected_stamps)


def test_bytes_that_are_no_such_message_are_counted_and_left_out() -> None:
    _, arrays = told()
    random = np.random.default_rng(2)
    parser = EstimatesParser()
    table, _ = parser.parse(arrivals([arrays[0], b"", arrays[1][:-9], b"\0\0" + arrays[1][2:]]))
    assert (len(table), parser.damaged) == (SIZES[0], 3)
    for end in range(0, len(arrays[3]), 37):
        assert len(parser.parse(arrivals([arrays[3][:end]]))[0]) == 0
    for _ in range(300):
        broken = bytearray(arrays[1])
        broken[int(random.integers(2, len(broken)))] = int(random.integers(256))
        assert len(parser.parse(arrivals([bytes(broken)]))[0]) in (0, SIZES[1])


def test_statistics_of_rows_are_those_of_messages() -> None:
    from hc_msgs.msg import HuntCrossleyEstimate

    each, arrays = told()
    one, many = EstimateStatistics(), EstimateStatistics()
    for data in each:
        one.add(deserialize_message(data, HuntCrossleyEstimate))
    for row in estimate_rows(EstimatesParser().parse(arrivals(arrays))[0]):
        many.add(row)
    for name in ("estimates", "lost", "restarts", "rejected", "changes", "mismatch", "force_n"):
        assert getattr(one, name) == getattr(many, name), name
    assert many.estimates == COUNT
    assert one.parameters() == many.parameters()
    assert one.parameters_std() == many.parameters_std()
    assert one.latest.header.stamp.nanosec == many.latest.header.stamp.nanosec


def bag_with(folder: Path, topics: dict[str, tuple[str, list[bytes]]]) -> Path:
    """Write a bag with samples, and these topics beside them."""
    if not (folder / "samples").exists():
        write_csv(folder / "a.csv", [np.column_stack([np.arange(9.0), np.ones(9), np.ones(9)])])
        csv_to_bag(folder / "a.csv", folder / "samples")
    target = folder / "_".join(topics).replace("/", "")
    with BagReader(folder / "samples") as reader, BagWriter(target) as writer:
        for name, topic in reader.topics.items():
            number = writer.add_topic(name, topic.definition.name, definition=topic.definition)
            for message in reader.messages({name}):
                writer.write(number, message.log_time, message.data)
        for name, (kind, messages) in topics.items():
            number = writer.add_topic(name, kind)
            for i, data in enumerate(messages):
                writer.write(number, START + i, data)
    return target


def test_a_bag_of_arrays_holds_the_estimates_of_each(tmp_path: Path) -> None:
    each, arrays = told()
    single = ("/hc/estimate", (ESTIMATE_TYPE, each))
    several = ("/hc/estimates", (ESTIMATES_TYPE, arrays))
    expected = read_recording(bag_with(tmp_path, dict([single]))).estimates
    assert_equal(read_recording(bag_with(tmp_path, dict([several]))).estimates, expected)
    both = read_recording(bag_with(tmp_path, dict([single, several]))).estimates
    order = np.argsort(both["sequence"])
    assert_equal(both[order], expected)
    half = ("/half", (ESTIMATE_TYPE, each[: SIZES[0]]))
    rest = ("/rest", (ESTIMATES_TYPE, arrays[1:]))
    switched = read_recording(bag_with(tmp_path, dict([half, rest])))
    assert sorted(switched.estimates["sequence"].tolist()) == expected["sequence"].tolist()


def test_a_damaged_message_of_arrays_in_a_bag_is_one_line(tmp_path: Path) -> None:
    _, arrays = told()
    damaged = [*arrays[:2], arrays[2][: len(arrays[2]) // 2]]
    bag = bag_with(tmp_path, {"/hc/estimates": (ESTIMATES_TYPE, damaged)})
    with pytest.raises(BagError, match="HuntCrossleyEstimates"):
        _ = read_recording(bag).estimates


def test_read_one_by_one_they_have_the_fields_of_an_estimate_each() -> None:
    """For the slave and the rig in lockstep, which take estimates one by one."""
    each, arrays = told()
    reader = EstimatesReader()
    found = [estimate for message in arrays for estimate in reader.read(message)]
    assert len(found) == len(each)
    of_the_message = {"header", "computation_time", "latency"}
    for estimate, alone in zip(found, each, strict=True):
        message = deserialize_message(alone, HuntCrossleyEstimate)
        stamp = message.header.stamp
        assert estimate.stamp_ns == stamp.sec * 10**9 + stamp.nanosec
        for name in set(message.get_fields_and_field_types()) - of_the_message:
            assert np.array_equal(getattr(estimate, name), getattr(message, name), equal_nan=True)
    with pytest.raises(AttributeError, match="temperature"):
        _ = found[0].temperature


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\1\0\0" + 400 * b"\xff"])
def test_what_is_no_message_of_estimates_is_counted_and_left_out(data: bytes) -> None:
    reader = EstimatesReader()
    assert reader.read(data) == []
    assert reader.undecodable == 1
