"""hc tare: force zero and contact position from the tool at rest, with the outcome."""

from __future__ import annotations

import argparse

from hc_bringup import zeroing_command

HEARTBEAT = True
HELP = "take force zero and contact position from the tool at rest, and print them"
TIMEOUT_S = 20.0


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    zeroing_command.configure(parser, timeout=f"wait no longer (default: {TIMEOUT_S:g})")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    return zeroing_command.run(arguments, "tare", arguments.timeout or TIMEOUT_S)
