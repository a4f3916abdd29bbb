"""Files that were damaged or made to harm: every command ends in a result or in one line.

The commands run in this process, many after another. A traceback, an "internal error" of the
guard, a warning of numpy, a second line on standard error, a number in a result that is none: each
is a failure. The ordinary run takes a hundred files, `-m slow` 2,000 of each format.
"""

from __future__ import annotations

import random
import resource
import shutil
import struct
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import lz4.frame
import pytest
import yaml
import zstandard

from hc_logger.mcap_scan import MAGIC
from hc_logger.recording import read_recording

ROOT = Path(__file__).resolve().parents[2]
FEW, MANY = 20, 2000
COUNTS = [FEW, pytest.param(MANY, marks=[pytest.mark.slow, pytest.mark.timeout(3600)])]


def mutate(data: bytes, rng: random.Random, pieces: list[bytes]) -> bytes:
    """Damage some bytes: flipped, cut out, doubled, replaced by something nasty."""
    data = bytearray(data)
    for _ in range(rng.choice((1, 1, 2, 5, 30))):
        if not data:
            break
        at = rng.randrange(len(data))
        kind = rng.randrange(5)
        if kind == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at : at + rng.choice((1, 3, 50, 2000))]
        elif kind == 2:
            end = at + rng.choice((1, 8, 300))
            data[at:at] = data[at:end]
        elif kind == 3:
            piece = rng.choice(pieces)
            data[at : at + len(piece)] = piece
        else:
            data[at:at] = rng.choice(pieces)
    return bytes(data)


CELLS = ["nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "", "x", '"', "1,2", "0x10", "1_0", "٣"]
CELLS += [
    "9" * 400,
    "-0",
    "1e5",
    "\t",
    ";",
    " ",
    "\ufeff",
    "NaN",
    "1e400",
    "0.001",
    "\x0b",
    "\u2028",
]


def hostile_table(text: str, rng: random.Random) -> bytes:
    """Damage a CSV by cells, rows, columns and bytes."""
    lines = text.splitlines()
    head, rows = lines[0], [line.split(",") for line in lines[1 : rng.choice((3, 40, 400, 1500))]]
    kind = rng.randrange(7)
    if kind == 0:
        for _ in range(rng.choice((1, 20, 400))):
            rows[rng.randrange(len(rows))][rng.randrange(3)] = rng.choice(CELLS)
    elif kind == 1:
        column, value = rng.randrange(3), rng.choice(CELLS)
        for row in rows:
            row[column] = value
    elif kind == 2:
        rng.shuffle(rows)
    elif kind == 3:
        column, factor = rng.randrange(3), rng.choice((-1.0, 1e-9, 1e6, 1e150, 1e300, 0.0))
        for row in rows:
            row[column] = repr(float(row[column]) * factor)
    elif kind == 4:
        head = rng.choice(["", "a,b,c", "force_N," + head, "1,2,3", head.upper(), "\0", '"' + head])
    elif kind == 5:
        for _ in range(rng.choice((1, 5))):
            row = rows[rng.randrange(len(rows))]
            row[:] = row[: rng.randrange(3)] if rng.random() < 0.5 else row * 3
    content = "\n".join([head, *(",".join(row) for row in rows)]).encode()
    if kind == 6:
        content = mutate(content, rng, [b"\0", b"\xff", b'"', b"\r", b",,,,", b"\n\n", b"1e999"])
    return content


@pytest.mark.parametrize("count", COUNTS)
def test_csv(shell: Any, good: Path, tmp_path: Path, count: int) -> None:
    rng = random.Random(11)
    text = (good / "good.csv").read_text()
    path = tmp_path / "hostile.csv"
    succeeded = 0
    for number in range(count):
        path.write_bytes(hostile_table(text, rng))
        succeeded += not shell("estimate", path, "--json", "--filter", "ukf")[0]
        if number % 10 == 0:
            shell("bag", "convert", path, tmp_path / "bag")
            shutil.rmtree(tmp_path / "bag", ignore_errors=True)
        if number % 20 == 0:
            shell("report", path, "-o", tmp_path / "page.png", "--filter", "ukf")
            (tmp_path / "page.png").unlink(missing_ok=True)
    assert count * 0.1 < succeeded < count * 0.95


@pytest.mark.parametrize("count", COUNTS)
def test_mcap(shell: Any, good: Path, tmp_path: Path, count: int) -> None:
    rng = random.Random(12)
    data = (good / "bag" / "bag_0.mcap").read_bytes()
    huge = [struct.pack("<Q", n) for n in (2**63, 2**40, 2**31, 100 * 2**30, 0)]
    pieces = [*huge, b"\x06", b"\x04zstd", b"lz4\0", b"float64[]", b"string ", MAGIC]
    path = tmp_path / "hostile.mcap"
    for number in range(count):
        path.write_bytes(mutate(data, rng, pieces))
        shell("bag", "info", path)
        kind = number % 4
        if kind == 0:
            shell("estimate", path, "--json", "--filter", "ukf")
        elif kind == 1:
            shell("bag", "recover", path, tmp_path / "clean")
            shutil.rmtree(tmp_path / "clean", ignore_errors=True)
        elif kind == 2:
            shell("bag", "convert", path, tmp_path / "out.csv")
            (tmp_path / "out.csv").unlink(missing_ok=True)


@pytest.mark.parametrize("count", COUNTS)
def test_mcap_with_estimates(shell: Any, tmp_path: Path, count: int) -> None:
    """The example: what was recorded beside the samples is read as well."""
    rng = random.Random(16)
    data = (ROOT / "bags" / "example" / "example_0.mcap").read_bytes()
    path = tmp_path / "hostile.mcap"
    page = tmp_path / "page.html"
    for number in range(count // 20):
        path.write_bytes(mutate(data, rng, [b"\x06", b"\0" * 300, MAGIC, b"\xff" * 8]))
        if number % 3:
            shell("estimate", path, "--verify")
        else:
            shell("report", path, "-o", page)
            page.unlink(missing_ok=True)


@pytest.mark.parametrize("count", COUNTS)
def test_message_definitions(shell: Any, good: Path, tmp_path: Path, count: int) -> None:
    """The texts of types in a bag without checksums: bits flipped, words replaced."""
    rng = random.Random(13)
    path = tmp_path / "hostile.mcap"
    sound = plain_mcap(good / "bag")
    pieces = [b"float64[4294967295] x\n", b"string[] s\n", b"std_msgs/Header header\n", b"MSG: "]
    pieces += [b"hc_msgs/IndenterSample x\n", b"=" * 80, b"int32 A=1\n", b"wstring<=3 x\n", b"[<=]"]
    start = sound.index(b"# ") if b"# " in sound else sound.index(b"std_msgs")
    for number in range(count):
        end = min(len(sound), start + 1500)
        text = mutate(sound[start:end], rng, pieces)
        text = text[: end - start].ljust(end - start, b"\n")  # the records keep their lengths
        path.write_bytes(sound[:start] + text + sound[end:])
        shell("bag", "info", path)
        if number % 2:
            shell("estimate", path, "--json", "--filter", "ukf")
        else:
            shell("bag", "convert", path, tmp_path / "out.csv")
            (tmp_path / "out.csv").unlink(missing_ok=True)


def plain_mcap(bag: Path) -> bytes:
    """The bag's samples in a file without chunks, compression and checksums."""
    from mcap.writer import CompressionType, IndexType, Writer

    from hc_logger.definitions import installed_definition
    from hc_logger.reader import BagReader

    path = bag.parent / "plain.mcap"
    definition = installed_definition("hc_msgs/msg/IndenterSample")
    with path.open("wb") as stream, BagReader(bag) as reader:
        writer = Writer(
            stream,
            use_chunking=False,
            compression=CompressionType.NONE,
            index_types=IndexType.NONE,
            enable_crcs=False,
        )
        writer.start("ros2", "test")
        schema = writer.register_schema(definition.name, "ros2msg", definition.text.encode())
        channel = writer.register_channel("/indenter/sample", "cdr", schema)
        for m in reader.messages({"/indenter/sample"}):
            writer.add_message(channel, m.log_time, m.data, m.publish_time)
        writer.finish()
    return path.read_bytes()


YAML_PIECES = [
    b"[",
    b"{",
    b"- ",
    b"&a ",
    b"*a",
    b"!!int ",
    b"2001-01-01",
    b"9" * 5000,
    b"\0",
    b"\xff",
]
YAML_PIECES += [
    b"[" * 3000,
    b"null",
    b": ",
    b"~",
    b"1",
    b"<<: *a",
    b"../../x",
    b"'",
    b"---\n",
    b".nan",
]


@pytest.mark.parametrize("count", COUNTS)
def test_metadata(shell: Any, good: Path, tmp_path: Path, count: int) -> None:
    rng = random.Random(14)
    bag = tmp_path / "bag"
    shutil.copytree(good / "bag", bag)
    sound = (bag / "metadata.yaml").read_bytes()
    tree = yaml.safe_load(sound)
    for number in range(count):
        content = (
            mutate(sound, rng, YAML_PIECES)
            if number % 2
            else yaml.safe_dump(replaced(tree, rng)).encode()
        )
        (bag / "metadata.yaml").write_bytes(content)
        shell("bag", "info", bag)
        if number % 20 == 0:
            shell("estimate", bag, "--json", "--filter", "ukf")


def replaced(tree: object, rng: random.Random) -> object:
    """The tree with some of its values replaced by values of other kinds."""
    values: list[object] = [None, 1, -1, 1.5, True, "", "x", [], {}, [1], {"a": 1}, [[]], 2**70]
    if rng.random() < 0.04:
        return rng.choice(values)
    if isinstance(tree, dict):
        return {k: replaced(v, rng) for k, v in tree.items() if rng.random() > 0.02}
    if isinstance(tree, list):
        return [replaced(v, rng) for v in tree]
    return tree


@pytest.mark.parametrize("count", COUNTS)
def test_configurations(shell: Any, tmp_path: Path, count: int) -> None:
    """Plans and parameter files of `hc run`; nothing is started: there is no such module."""
    rng = random.Random(15)
    root = ROOT / "config"
    plan = (root / "run.yaml").read_bytes().replace(b"hc_", b"no_")
    parameters = (root / "recorder.yaml").read_bytes()
    for number in range(count):
        plan_now = mutate(plan, rng, YAML_PIECES) if number % 2 else plan
        parameters_now = parameters if number % 2 else mutate(parameters, rng, YAML_PIECES)
        for name in ("indenter", "estimator"):
            shutil.copy(root / f"{name}.yaml", tmp_path / f"{name}.yaml")
        (tmp_path / "recorder.yaml").write_bytes(parameters_now)
        (tmp_path / "run.yaml").write_bytes(plan_now)
        status, _, _ = shell(
            "run", tmp_path / "run.yaml", "--scenario", "atlantis", "--bag", tmp_path / "bag"
        )
        assert status


def chunk(compression: bytes, packed: bytes, stated: int, checksum: int = 0) -> bytes:
    body = struct.pack("<QQQI", 0, 1, stated, checksum)
    body += (
        struct.pack("<I", len(compression)) + compression + struct.pack("<Q", len(packed)) + packed
    )
    return b"\x06" + struct.pack("<Q", len(body)) + body


def zstd_that_claims(size: int) -> bytes:
    """A frame whose head states a size, with nothing behind it."""
    return struct.pack("<IBQ", 0xFD2FB528, 0xC0 | 0x20, size) + b"\x01\0\0"


ZEROS = bytes(64 * 1024 * 1024)
BOMBS: dict[str, Callable[[], bytes]] = {
    "zstd frame claims 100 GiB": lambda: chunk(b"zstd", zstd_that_claims(100 * 2**30), 1000),
    "chunk claims 100 GiB": lambda: chunk(b"zstd", zstd_that_claims(100 * 2**30), 100 * 2**30),
    "chunk claims 1 GiB": lambda: chunk(b"", b"", 2**30),
    "zstd zeros": lambda: chunk(b"zstd", zstandard.compress(ZEROS * 8), len(ZEROS) * 8),
    "zstd zeros, small claim": lambda: chunk(b"zstd", zstandard.compress(ZEROS), 1000),
    "lz4 zeros": lambda: chunk(b"lz4", lz4.frame.compress(ZEROS * 8), len(ZEROS) * 8),
    "lz4 zeros, small claim": lambda: chunk(b"lz4", lz4.frame.compress(ZEROS), 1000),
    "a million empty records": lambda: chunk(
        b"zstd",
        zstandard.compress(EMPTY_RECORDS),
        len(EMPTY_RECORDS),
        zlib.crc32(EMPTY_RECORDS),
    ),
}
EMPTY_RECORDS = (b"\x0f" + bytes(8)) * 1_700_000


@pytest.fixture
def little_memory() -> Iterator[None]:
    """No more than 1.5 GiB beyond what this process has already."""
    before = resource.getrlimit(resource.RLIMIT_AS)
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    limit = pages * resource.getpagesize() + 1536 * 1024 * 1024
    resource.setrlimit(resource.RLIMIT_AS, (limit, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_AS, before)


@pytest.mark.parametrize("name", BOMBS)
def test_a_bomb_is_named_and_the_rest_is_read(
    shell: Any, good: Path, tmp_path: Path, name: str, little_memory: None
) -> None:
    data = (good / "bag" / "bag_0.mcap").read_bytes()
    path = tmp_path / "bomb.mcap"
    # After the head of the file, before its first chunk.
    first = data.index(b"\x06", len(MAGIC) + 9 + data[len(MAGIC) + 1])
    path.write_bytes(data[:first] + BOMBS[name]() + data[first:])
    begin = time.process_time()
    status, out, _ = shell("bag", "info", path)
    assert status == 0
    assert "is damaged (" in out
    assert time.process_time() - begin < 10.0
    assert len(read_recording(path).time_s) == 1500


def test_a_tiny_file_that_claims_much(shell: Any, tmp_path: Path, little_memory: None) -> None:
    path = tmp_path / "tiny.mcap"
    path.write_bytes(MAGIC + BOMBS["zstd frame claims 100 GiB"]())
    assert path.stat().st_size < 120
    status, _, err = shell("estimate", path)
    assert status == 1
    assert "its frame states 107374182400 instead of 1000 bytes" in err


def test_a_bomb_in_the_metadata(shell: Any, good: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    shutil.copytree(good / "bag", bag)
    laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12)
    )
    (bag / "metadata.yaml").write_text(laughs + "rosbag2_bagfile_information: *a11\n")
    status, _, err = shell("bag", "info", bag)
    assert status == 1
    assert "holds more than 1000000 values" in err
