"""Makes a clean bag of one that was cut off or damaged, and says what was lost."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from hc_logger.convert import Progress, copy_messages, nothing
from hc_logger.errors import BagError, MetadataError
from hc_logger.mcap_file import McapFile
from hc_logger.reader import BagReader
from hc_logger.writer import BagWriter, os_errors

RECOVERED_FROM = "recovered_from"
"""Key of the new bag's custom data that names the old one."""


@dataclass
class RecoveryReport:
    """What `hc bag recover` did.

    Attributes:
        recovered: messages in the new bag, by topic.
        lost: messages that the index of the old bag lists and that cannot be read, by topic.
        lost_bytes: bytes of the old files that could not be used.
        lost_spans: first and last log time (ns) of each chunk that cannot be read.
        unknown_channels: messages that were readable but of a topic whose description is lost.
        problems: one line for each damaged place.
        cut_chunk: whether a chunk was cut off, of which a part was read.
    """

    recovered: dict[str, int] = field(default_factory=dict)
    lost: dict[str, int] = field(default_factory=dict)
    lost_bytes: int = 0
    lost_spans: list[tuple[int, int]] = field(default_factory=list)
    unknown_channels: int = 0
    problems: list[str] = field(default_factory=list)
    cut_chunk: bool = False

    @property
    def clean(self) -> bool:
        """True if the old bag had no damage."""
        return not self.problems

    def lines(self) -> list[str]:
        """Return what to tell the user, one line each."""
        total = sum(self.recovered.values())
        lines = [f"recovered {total} messages of {len(self.recovered)} topics"]
        if self.clean:
            return [*lines, "nothing was lost: the bag was whole"]
        lines += self.problems
        lines += [f"lost {count} messages of {topic}" for topic, count in self.lost.items()]
        lines += [
            f"lost {(end - start) * 1e-9:.3f} s from {start * 1e-9:.6f}"
            for start, end in self.lost_spans
        ]
        if self.unknown_channels:
            lines.append(
                f"lost {self.unknown_channels} messages whose topic's description is damaged"
            )
        rest = ", and the rest of a chunk that was cut" if self.cut_chunk else ""
        lines.append(f"lost {self.lost_bytes} bytes{rest}")
        return lines


def recover_bag(
    source: str | os.PathLike[str],
    target: str | os.PathLike[str],
    *,
    progress: Progress = nothing,
) -> RecoveryReport:
    """Copy every readable message of a bag into a new one.

    Args:
        source: bag folder or MCAP file, cut off or damaged; stays as it is.
        target: folder of the new bag; must not exist.
        progress: told the done share.

    Raises:
        BagError: if nothing can be recovered or the target exists.
    """
    source = Path(source)
    reader, problem = _opened(source)
    with reader:
        if not reader.topics:
            because = "; ".join(reader.problems) or "it holds no topic"
            raise BagError(f"nothing can be recovered from {source}: {because}")
        report = RecoveryReport()
        with os_errors(f"cannot write {target}"):
            data = {**reader.custom_data, RECOVERED_FROM: source.resolve().name}
            with BagWriter(target, custom_data=data) as writer:
                report.recovered = copy_messages(reader, writer, progress=progress)
                if reader.problems and not any(report.recovered.values()):
                    because = "; ".join(reader.problems)
                    raise BagError(f"nothing can be recovered from {source}: {because}")
        _account(reader, report)
        if problem:
            report.problems.insert(0, problem)
    return report


def _opened(source: Path) -> tuple[BagReader, str]:
    """Open a bag; by its files alone, and with one line about it, if its metadata are damaged."""
    try:
        return BagReader(source), ""
    except MetadataError as error:
        because = str(error).partition(";")[0]
        return BagReader(source, trust_metadata=False), f"{because}: left out of account"


def _account(reader: BagReader, report: RecoveryReport) -> None:
    """Find out what the damaged places held."""
    report.problems = reader.problems
    for file in reader.files:
        names = {number: channel.topic for number, channel in file.scan.channels.items()}
        report.lost_bytes += sum(end - start for start, end in file.scan.unreadable)
        for damage in file.damaged:
            report.lost_bytes += damage.place.length
            report.lost_spans.append((damage.place.start_ns, damage.place.end_ns))
            for channel, count in file.indexed_counts(damage.place).items():
                topic = names.get(channel, f"channel {channel}")
                report.lost[topic] = report.lost.get(topic, 0) + count
        report.cut_chunk |= bool(file.scan.cut_chunk)
        report.unknown_channels += _of_unknown_channels(file)


def _of_unknown_channels(file: McapFile) -> int:
    """Count messages whose channel nothing describes (only possible where chunks are damaged)."""
    if not file.damaged and not file.scan.unreadable:
        return 0
    known = np.array(sorted(file.scan.channels), np.int64)
    return sum(int(np.count_nonzero(~np.isin(m.channel, known))) for m in file.chunks())
