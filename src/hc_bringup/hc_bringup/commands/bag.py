"""hc bag: look into a bag, repair one that was cut off, convert, filter, merge and split."""

from __future__ import annotations

import argparse
import json
import math
import shlex
from datetime import datetime
from pathlib import Path
from typing import Any

from hc_bringup import recording_input
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import bag_folder_name, bag_or_csv_name, natural, positive, seconds
from hc_msgs_py.plain_text import in_one_line

HELP = "look into a bag, repair one that was cut off, convert, filter, merge and split bags"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="ACTION", required=True)
    info = commands.add_parser("info", help="topics, counts, rates and gaps of a bag")
    info.add_argument("bag", metavar="BAG")
    recover = commands.add_parser("recover", help="copy what is readable of a damaged bag")
    recover.add_argument("source", metavar="SOURCE", help="bag folder or .mcap file")
    recover.add_argument(
        "target", type=bag_folder_name, metavar="TARGET", help="folder of the new bag"
    )
    convert = commands.add_parser("convert", help="CSV to bag, bag to CSV, sqlite3 bag to MCAP")
    convert.add_argument("source", metavar="SOURCE", help="CSV file or bag")
    convert.add_argument(
        "target",
        type=bag_or_csv_name,
        metavar="TARGET",
        help="bag folder, or a file that ends in .csv",
    )
    convert.add_argument("--topic", default="", metavar="T", help="sample topic, if several")
    convert.add_argument(
        "--taxel",
        type=natural,
        metavar="N",
        help="of a tactile array in a bag, counted row by row from 0: its table",
    )
    recording_input.add_csv_options(convert)
    part = commands.add_parser("filter", help="copy some topics or seconds of a bag")
    part.add_argument("source", metavar="SOURCE", help="bag")
    part.add_argument(
        "target", type=bag_folder_name, metavar="TARGET", help="folder of the new bag"
    )
    part.add_argument(
        "--topics", nargs="+", default=["*"], metavar="TOPIC", help="names, or patterns with *"
    )
    part.add_argument("--exclude", nargs="+", default=[], metavar="TOPIC", help="leave these out")
    begin = "begin S s after the first sample (default: with what lies before it, too)"
    part.add_argument("--start", type=seconds, default=0.0, metavar="S", help=begin)
    take = "take S s from there (default: to the end)"
    part.add_argument("--duration", type=positive, default=math.inf, metavar="S", help=take)
    merge = commands.add_parser("merge", help="several bags into one, in the order of time")
    merge.add_argument("sources", nargs="+", metavar="SOURCE", help="bags")
    merge.add_argument(
        "-o",
        "--output",
        type=bag_folder_name,
        required=True,
        metavar="TARGET",
        help="the new bag",
    )
    split = commands.add_parser("split", help="cut a bag into parts of some seconds")
    split.add_argument("source", metavar="SOURCE", help="bag")
    split.add_argument(
        "target",
        type=bag_folder_name,
        metavar="TARGET",
        help="the parts are TARGET_0, TARGET_1 ...",
    )
    split.add_argument("--every", type=positive, required=True, metavar="S", help="S s each")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_logger.errors import BagError, BagExistsError, WrongOptionError

    try:
        actions = {
            "info": _info,
            "recover": _recover,
            "convert": _convert,
            "filter": _filter,
            "merge": _merge,
            "split": _split,
        }
        return actions[arguments.action](arguments)
    except (BagExistsError, WrongOptionError) as error:
        raise UserError(str(error), WRONG_USE) from error
    except BagError as error:
        raise UserError(str(error)) from error


def _info(arguments: argparse.Namespace) -> int:
    from hc_logger.info import bag_info

    print(_info_text(bag_info(arguments.bag)))
    return 0


def _info_text(info: Any) -> str:
    """Return what `ros2 bag info` shows, with rates and gaps."""
    start = datetime.fromtimestamp(info.start_ns * 1e-9)
    lines = [
        f"Files:     {', '.join(info.files)}",
        f"Size:      {info.size_bytes / 1024:.1f} KiB",
        f"Duration:  {info.duration_s:.6f} s",
        f"Start:     {start:%Y-%m-%d %H:%M:%S.%f}",
        f"Messages:  {info.message_count}",
    ]
    for key, value in sorted(info.custom_data.items()):
        nodes = _nodes(value) if key == "configuration" else []
        lines += nodes or [f"{key + ':':<10} {value}"]
    table = [("Topic", "Type", "Count", "Rate Hz", "Longest gap s", "Gaps", "Lost")]
    for topic in info.topics:
        table.append(
            (
                in_one_line(topic.name),
                in_one_line(topic.type_name),
                str(topic.message_count),
                _number(topic.rate_hz, ".2f"),
                _number(topic.longest_interval_s, ".4f"),
                str(topic.gaps),
                _number(topic.lost, "d"),
            )
        )
    widths = [max(len(row[i]) for row in table) for i in range(len(table[0]))]
    for row in table:
        cells = [
            cell.ljust(width) if i < 2 else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    lines += [
        f"{topic.name}: displacement {topic.displacement_hz:.2f} Hz, force {topic.force_hz:.2f} Hz"
        for topic in info.topics
        if topic.displacement_hz is not None
        and topic.force_hz is not None
        and topic.displacement_hz != topic.force_hz
    ]
    lines += [
        f"{topic.name}: the numbers of the messages are no count (several publishers?), losses "
        "cannot be told"
        for topic in info.topics
        if topic.is_no_count
    ]
    lines += [f"Problem:   {problem}" for problem in info.problems]
    return "\n".join(lines)


def _nodes(configuration: str) -> list[str]:
    """Return a line for each node of the run that recorded a bag; none if it says no such thing."""
    try:
        nodes = json.loads(configuration)
        lines = []
        for node in nodes:
            words = [str(node["module"]), *map(str, node.get("parameter_files", []))]
            words += [f"{name}={value}" for name, value in node.get("parameters", {}).items()]
            lines.append(f"{'Node:':<10} {node['name']}: {', '.join(words)}")
    except (ValueError, TypeError, KeyError, AttributeError):
        return []  # it is shown as it stands
    return lines


def _number(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)


def _recover(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_logger.recover import recover_bag

    with progress_bar("recovering") as progress:
        report = recover_bag(arguments.source, arguments.target, progress=progress)
    for line in report.lines():
        print(line)
    return 0


def _convert(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_logger.convert import bag_to_bag, bag_to_csv, csv_to_bag
    from hc_logger.csv_file import CsvReader, write_csv
    from hc_logger.csv_open import is_text

    source, target = Path(arguments.source), Path(arguments.target)
    to_csv = target.suffix.lower() == ".csv"
    from_csv = is_text(source) and not source.is_dir()
    if from_csv and arguments.topic:
        raise UserError("--topic is for a bag: a CSV file has none", WRONG_USE)
    if arguments.topic and not to_csv:
        raise UserError(
            "--topic is for a bag that becomes CSV; hc bag filter takes some topics of a bag",
            WRONG_USE,
        )
    if arguments.taxel is not None and (from_csv or not to_csv):
        raise UserError("--taxel is for a bag that becomes CSV", WRONG_USE)
    if not from_csv and source.exists():
        recording_input.refuse_csv_options(arguments, source)
    reader = CsvReader(source, recording_input.csv_options(arguments)) if from_csv else None
    what = "samples"
    problems: list[str] = []
    with progress_bar(f"{source.name} to {target.name}") as progress:
        if reader is not None and to_csv:
            count = write_csv(target, reader.blocks())
        elif to_csv:
            count, problems = bag_to_csv(
                source, target, topic=arguments.topic, taxel=arguments.taxel, progress=progress
            )
        elif reader is not None:
            count = csv_to_bag(source, target, reader=reader, progress=progress)
        else:
            what = "messages"
            counts, problems = bag_to_bag(source, target, progress=progress)
            count = sum(counts.values())
    for problem in reader.notes if reader is not None else problems:
        print(f"{source}: {problem}")
    print(f"{count} {what} written to {target}")
    return 0


def _filter(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_logger.edit import filter_bag
    from hc_logger.selection import TopicSelection

    with progress_bar("filtering") as progress:
        count, problems = filter_bag(
            arguments.source,
            arguments.target,
            selection=TopicSelection(arguments.topics, arguments.exclude),
            start_s=arguments.start,
            duration_s=arguments.duration,
            progress=progress,
        )
    look = f"hc bag info {shlex.quote(arguments.source)}"
    none = "" if count else f": none is of these topics and seconds, see {look}"
    for problem in problems:
        print(f"{arguments.source}: {problem}")
    print(f"{count} messages written to {arguments.target}{none}")
    return 0


def _merge(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_logger.edit import merge_bags

    if len(arguments.sources) < 2:
        raise UserError("give two bags at least", WRONG_USE)
    with progress_bar("merging") as progress:
        count, problems = merge_bags(arguments.sources, arguments.output, progress=progress)
    for problem in problems:
        print(problem)
    print(f"{count} messages of {len(arguments.sources)} bags written to {arguments.output}")
    return 0


def _split(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_logger.edit import split_bag

    with progress_bar("splitting") as progress:
        parts, problems = split_bag(
            arguments.source, arguments.target, arguments.every, progress=progress
        )
    for problem in problems:
        print(f"{arguments.source}: {problem}")
    for path, count in parts:
        print(f"{count} messages written to {path}")
    return 0
