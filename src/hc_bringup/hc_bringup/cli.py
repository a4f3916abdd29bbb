"""The hc command: finds the subcommand, runs it, turns errors into one line and a status."""

from __future__ import annotations

import argparse
import importlib
import os
import sys
from collections.abc import Sequence
from typing import Any, Final, NoReturn

from hc_bringup.errors import WRONG_USE, UserError

COMMANDS: Final = (
    "run",
    "replay",
    "estimate",
    "simulate",
    "bag",
    "node",
    "topic",
    "param",
    "service",
    "tare",
    "find-surface",
    "reset",
    "save",
    "load",
    "setup",
    "doctor",
    "payload",
    "reproduce",
    "bench",
    "report",
    "test",
)
"""Modules of hc_bringup.commands; each has configure(parser) and run(arguments) -> status."""


class _Parser(argparse.ArgumentParser):
    """argparse, with wrong use told in one line."""

    def error(self, message: str) -> NoReturn:
        line = message[:1].lower() + message[1:]
        self.exit(WRONG_USE, f"{self.prog}: {line} (see {self.prog} --help)\n")


def _parser(command: str | None) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="hc",
        description="Online characterization of soft tissue: rig, estimators, bags.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = _module(name)
        sub = commands.add_parser(name, help=module.HELP, description=module.HELP)
        if command is None or name == command:
            module.configure(sub)
    return parser


def _module(command: str) -> Any:
    return importlib.import_module(f"hc_bringup.commands.{command.replace('-', '_')}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the hc command.

    Args:
        arguments: command line without the program's name; None takes sys.argv.

    Returns:
        Exit status: 0, 1 for a failure, 2 for wrong use.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    parser = _parser(words[0] if words else None)
    parsed = parser.parse_args(words)
    module = _module(parsed.command)
    try:
        return int(module.run(parsed))
    except UserError as error:
        output = getattr(error, "output", "")
        if output:
            sys.stderr.write(f"{output}\n")
        sys.stderr.write(f"hc {parsed.command}: {error}\n")
        return error.status
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # the reader of our output has seen enough: hc topic echo | head
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


if __name__ == "__main__":
    sys.exit(main())
