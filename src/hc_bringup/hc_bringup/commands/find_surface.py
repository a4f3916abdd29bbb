"""hc find-surface: force zero and contact position from an approach, with the outcome."""

from __future__ import annotations

import argparse

from hc_bringup import zeroing_command

HEARTBEAT = True
HELP = "find force zero and contact position while you press, and print them"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    zeroing_command.configure(parser, timeout="wait no longer (default: until Ctrl-C)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    return zeroing_command.run(arguments, "find_surface", arguments.timeout)
