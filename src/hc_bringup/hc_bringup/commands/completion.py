"""hc completion: prints what makes a shell complete the words of hc."""

from __future__ import annotations

import argparse

HELP = "print the line that makes bash, zsh or fish complete the words of hc"
SHELLS = ("bash", "zsh", "fish")


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("shell", choices=SHELLS, help='then: eval "$(hc completion bash)"')


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from argcomplete.shell_integration import shellcode

    print(shellcode(["hc"], shell=arguments.shell))
    return 0
