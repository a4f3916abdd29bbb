"""hc record: record topics into a bag until Ctrl-C, as `ros2 bag record` does."""

from __future__ import annotations

import argparse
import sys
import tempfile
from typing import Any

import yaml

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import natural, seconds

HELP = "record topics into a bag until Ctrl-C"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("topics", nargs="*", metavar="TOPIC", help="names, or patterns with *")
    parser.add_argument("-a", "--all", action="store_true", help="all topics")
    parser.add_argument("-x", "--exclude", action="append", default=[], metavar="TOPIC")
    parser.add_argument(
        "-o", "--output", metavar="DIR", help="folder of the bag (default: bags/run_DATE_TIME here)"
    )
    parser.add_argument(
        "-d",
        "--max-bag-duration",
        type=seconds,
        metavar="S",
        help="new file after S s, 0 for never (default: an hour)",
    )
    parser.add_argument(
        "-b",
        "--max-bag-size",
        type=natural,
        default=0,
        metavar="BYTES",
        help="new file after so much",
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command: the recorder node in this process, so that its signals are its own."""
    from hc_bringup.commands.run import new_bag_folder
    from hc_bringup.domain_lock import domain_id
    from hc_bringup.graph import topic_name
    from hc_logger.metadata import read_information
    from hc_logger.recorder_node import main
    from hc_msgs_py.topics import NODE_RECORDER

    if bool(arguments.topics) == arguments.all:
        raise UserError("name topics, or give -a for all of them", WRONG_USE)
    for name in (*arguments.topics, *arguments.exclude):
        topic_name(name)
    domain_id()
    bag = new_bag_folder(arguments.output, "-o")
    parameters: dict[str, Any] = {
        "output": str(bag),
        "topics": ["*"] if arguments.all else arguments.topics,
        "exclude": arguments.exclude or [""],
        "max_file_bytes": arguments.max_bag_size,
    }
    if arguments.max_bag_duration is not None:
        parameters["max_file_duration"] = arguments.max_bag_duration
    # A file, for on the command line of ROS a topic or a folder may read as something else.
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
        yaml.safe_dump({NODE_RECORDER: {"ros__parameters": parameters}}, file)
        file.flush()
        print(f"recording into {bag}; Ctrl-C ends it", flush=True)
        before, sys.argv = sys.argv, ["hc record", "--ros-args", "--params-file", file.name]
        try:
            status = main()
        finally:
            sys.argv = before
    information = read_information(bag)
    if information is not None:
        print(f"{information['message_count']} messages written to {bag}")
    return status
