"""Bags whose records are wrong under checksums that are right: nothing but the content warns.

Damage by bytes mostly ends at a checksum. Here records are changed, doubled, swapped and retyped,
inside chunks as well, and the chunks packed again.
"""

from __future__ import annotations

import contextlib
import random
import shutil
import sqlite3
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import zstandard

from hc_logger.foreign import open_bag
from hc_logger.mcap_scan import MAGIC
from hc_logger.writer import BagWriter

COUNTS = [16, pytest.param(2000, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]
EXAMPLE = Path(__file__).resolve().parents[2] / "bags" / "example" / "example_0.mcap"
FOOTER, MESSAGE, CHUNK = 2, 5, 6
NUMBERS = (0, 1, 2**31, 2**32 - 1, 2**53, 2**62, 2**63 - 1, 2**63, 2**64 - 1, 10**18)
TEXTS = (
    b"float64[]",
    b"float64[999999999]",
    b"string<=4",
    b"MSG: a/b\nfloat64 x\n",
    b"string S='\n",
)
TEXTS += (
    b"hc_msgs/IndenterSample s\n",
    b"int8 X=999\n",
    b"[",
    b"=",
    b"#",
    b"\n",
    b"\0",
    b"\xff\xfe",
)
TEXTS += (
    b"ros1",
    b"json",
    b"." * 50,
    b"/" * 50,
    b"int32[2**9] y\n",
    b"uint64[18446744073709551616] z\n",
)

Record = tuple[int, bytes]


def records(data: bytes) -> Iterator[Record]:
    """Operation codes and contents, one after another."""
    at = 0
    while at + 9 <= len(data):
        (length,) = struct.unpack_from("<Q", data, at + 1)
        yield data[at], data[at + 9 : at + 9 + length]
        at += 9 + length


def joined(parts: list[Record]) -> bytes:
    return b"".join(bytes([code]) + struct.pack("<Q", len(body)) + body for code, body in parts)


def chunk_parts(body: bytes) -> tuple[bytes, bytes]:
    """The head up to the sizes, and the unpacked records."""
    (length,) = struct.unpack_from("<I", body, 28)
    name, packed = body[32 : 32 + length], body[40 + length :]
    (size,) = struct.unpack_from("<Q", body, 16)
    if name == b"zstd":
        packed = zstandard.ZstdDecompressor().decompress(packed, max_output_size=size)
    elif name == b"lz4":
        packed = lz4.frame.decompress(packed)
    return body[:16], packed


def new_chunk(head: bytes, content: bytes, rng: random.Random) -> bytes:
    """The records packed again, with the checksum that they should have."""
    name = rng.choice((b"zstd", b"lz4", b""))
    packed = {b"zstd": zstandard.compress, b"lz4": lz4.frame.compress, b"": bytes}[name](content)
    sizes = struct.pack("<QII", len(content), zlib.crc32(content), len(name))
    return head + sizes + name + struct.pack("<Q", len(packed)) + packed


def with_numbers(body: bytes, rng: random.Random) -> bytes:
    changed = bytearray(body)
    for _ in range(rng.choice((1, 1, 3))):
        if len(changed) > 8:
            at, width = rng.randrange(len(changed) - 8), rng.choice((1, 2, 4, 8))
            value = rng.choice((*NUMBERS, len(body))) % 2 ** (8 * width)
            changed[at : at + width] = value.to_bytes(width, "little")
    return bytes(changed)


def with_texts(body: bytes, rng: random.Random) -> bytes:
    changed = bytearray(body)
    for _ in range(rng.choice((1, 2, 6))):
        at = rng.randrange(len(changed) + 1)
        changed[at : at + rng.choice((0, 0, 5, 40))] = rng.choice((b"", *TEXTS))
    return bytes(changed)


def damaged(parts: list[Record], rng: random.Random) -> list[Record]:
    """Some of the records changed; those of rare kinds as often as messages."""
    parts = list(parts)
    for _ in range(rng.choice((1, 1, 2, 4))):
        if not parts:
            break
        code = rng.choice(sorted({code for code, _ in parts}))
        at = rng.choice([i for i, part in enumerate(parts) if part[0] == code])
        body, kind = parts[at][1], rng.randrange(9)
        if kind == 0:
            parts[at] = (code, with_numbers(body, rng))
        elif kind == 1:
            parts[at] = (code, with_texts(body, rng))
        elif kind == 2:
            parts[at] = (rng.randrange(256), body)
        elif kind == 3:
            del parts[at]
        elif kind == 4:
            parts[at:at] = [(code, body)] * rng.choice((1, 2, 300))
        elif kind == 5:
            other = rng.randrange(len(parts))
            parts[at], parts[other] = parts[other], parts[at]
        elif kind == 6:
            parts[at] = (code, body[: rng.randrange(len(body) + 1)])
        elif kind == 7:
            parts[at] = (code, body + bytes(rng.choice((1, 8, 10_000))))
        else:
            parts[at] = (code, rng.randbytes(len(body)))
    return parts


def hostile_bag(sound: bytes, rng: random.Random) -> bytes:
    """A whole file with wrong records, inside its chunks or between them."""
    inside = rng.random() < 0.7
    parts = []
    for code, body in records(sound[len(MAGIC) : -len(MAGIC)]):
        if code == CHUNK and inside and rng.random() < 0.5:
            head, content = chunk_parts(body)
            body = new_chunk(head, joined(damaged(list(records(content)), rng)), rng)
        parts.append((code, body))
    if not inside or rng.random() < 0.3:
        parts = damaged(parts, rng)
    return MAGIC + joined(parts) + MAGIC


@pytest.mark.parametrize("count", COUNTS)
def test_wrong_records_under_right_checksums(
    shell: Any, good: Path, tmp_path: Path, count: int
) -> None:
    rng = random.Random(21)
    sounds = ((good / "bag" / "bag_0.mcap").read_bytes(), EXAMPLE.read_bytes())
    path, folder = tmp_path / "hostile.mcap", tmp_path / "out"
    csv, page = tmp_path / "out.csv", tmp_path / "page.html"
    for number in range(count):
        path.write_bytes(hostile_bag(sounds[number % 5 == 0], rng))
        kind = number % 8
        if kind < 2:
            shell("estimate", path, "--json", "--filter", "ukf")
        elif kind == 2:
            shell("bag", "convert", path, csv)
        elif kind == 3:
            shell("bag", "convert", path, folder)
        elif kind == 4:
            shell("bag", "recover", path, folder)
        elif kind == 5:
            shell("estimate", path, "--verify")
        elif kind == 6:
            shell("contacts", path, "-o", csv, "--filter", "ukf")
        else:
            shell("report", path, "-o", page, "--filter", "ukf")
        shutil.rmtree(folder, ignore_errors=True)
        csv.unlink(missing_ok=True)
        page.unlink(missing_ok=True)


def test_a_time_beyond_2262_is_copied_as_it_is(shell: Any, good: Path, tmp_path: Path) -> None:
    """Regression: it reads as a negative one, which ended convert and recover in an error."""
    parts = []
    for code, body in records((good / "bag" / "bag_0.mcap").read_bytes()[len(MAGIC) : -len(MAGIC)]):
        if code == CHUNK and CHUNK not in (code for code, _ in parts):
            head, content = chunk_parts(body)
            inner = list(records(content))
            at = next(i for i, (code, _) in enumerate(inner) if code == 5)
            message = inner[at][1]
            times = struct.pack("<QQ", 2**63 + 5, 2**64 - 1)  # behind channel and sequence
            inner[at] = (5, message[:6] + times + message[22:])
            body = new_chunk(head, joined(inner), random.Random(0))
        parts.append((code, body))
    path = tmp_path / "late.mcap"
    path.write_bytes(MAGIC + joined(parts) + MAGIC)
    for words in (("convert",), ("recover",)):
        copy = tmp_path / words[0]
        assert shell("bag", *words, path, copy)[0] == 0
        with open_bag(path) as bag, open_bag(copy) as same:
            times = [[(m.log_time, m.publish_time) for m in b.messages()] for b in (bag, same)]
        assert sorted(times[0]) == sorted(times[1])
        assert (5 - 2**63, -1) in times[0]
        assert shell("bag", "info", copy)[0] == 0


def test_a_damaged_truth_is_left_out_and_named(shell: Any, good: Path, tmp_path: Path) -> None:
    """Regression: `hc report`, and contacts and compare likewise, ended in an internal error."""
    writer = BagWriter(tmp_path / "bag")
    with open_bag(good / "bag") as bag:
        numbers = {
            name: writer.add_topic(name, topic.definition.name)
            for name, topic in bag.topics.items()
        }
        for message in bag.messages():
            data = message.data[:9] if message.topic == "/indenter/truth" else message.data
            writer.write(numbers[message.topic], message.log_time, data)
    writer.close()
    page = tmp_path / "page.html"
    assert shell("report", tmp_path / "bag", "-o", page, "--filter", "ukf")[0] == 0
    assert "the truth cannot be read" in page.read_text()


def changed(good: Path, code: int, change: Callable[[bytes], bytes]) -> bytes:
    """The sound bag, with the first record of a kind changed, in its chunk or outside."""
    parts, done = [], False
    for kind, body in records((good / "bag" / "bag_0.mcap").read_bytes()[len(MAGIC) : -len(MAGIC)]):
        if kind == code and not done:
            body, done = change(body), True
        elif kind == CHUNK and code == MESSAGE:
            head, content = chunk_parts(body)
            inner = [(k, change(b) if k == code else b) for k, b in records(content)]
            body = new_chunk(head, joined(inner), random.Random(0))
        parts.append((kind, body))
    return MAGIC + joined(parts) + MAGIC


def test_messages_without_a_byte(shell: Any, good: Path, tmp_path: Path) -> None:
    """Regression: an array that numpy cannot shape was an internal error."""
    path = tmp_path / "empty.mcap"
    path.write_bytes(changed(good, MESSAGE, lambda body: body[:22]))
    assert shell("bag", "convert", path, tmp_path / "out.csv")[0] == 1
    assert shell("estimate", path)[0] == 1


def test_a_summary_that_begins_nowhere(shell: Any, good: Path, tmp_path: Path) -> None:
    """Regression: no file can be read from byte 2^63 on, which was told as an internal error."""
    path = tmp_path / "footer.mcap"
    path.write_bytes(changed(good, FOOTER, lambda body: struct.pack("<QQI", 2**63, 0, 1)))
    assert shell("bag", "info", path)[0] == 0
    assert shell("estimate", path, "--filter", "ukf")[0] == 0


def test_a_bag_of_others_with_texts_for_messages(shell: Any, tmp_path: Path) -> None:
    """Regression: sqlite3 gives out whatever was put in, a text for bytes, say."""
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    bag = tmp_path / "bag"
    with Writer(bag, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        kind = "geometry_msgs/msg/WrenchStamped"
        connection = writer.add_connection("/wrench", kind, typestore=store)
        writer.write(connection, 1, b"\0\1\0\0")
    (file,) = bag.glob("*.db3")
    with contextlib.closing(sqlite3.connect(file)) as database:
        database.execute("update messages set data = 'text'")
        database.commit()
    status, _, err = shell("bag", "convert", bag, tmp_path / "copy")
    assert status == 1
    assert "a message is of another kind" in err
