"""The hc command: finds the subcommand, runs it, turns errors into one line and a status."""

from __future__ import annotations

import argparse
import difflib
import importlib
import importlib.metadata
import io
import os
import re
import signal
import sys
from collections.abc import Sequence
from types import FrameType
from typing import Any, Final, NoReturn

from hc_bringup import heartbeat, last_resort, standard_output
from hc_bringup.errors import FAILURE, WRONG_USE, UserError, shortened
from hc_bringup.guard import explain
from hc_bringup.plain_stream import make_plain
from hc_bringup.wrapping import wrapped
from hc_msgs_py.interface_class import UnknownInterfaceError

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
    "lifecycle",
    "record",
    "tare",
    "find-surface",
    "reset",
    "save",
    "load",
    "setup",
    "doctor",
    "payload",
    "compliance",
    "reproduce",
    "bench",
    "report",
    "compare",
    "contacts",
    "batch",
    "dashboard",
    "new",
    "completion",
    "test",
)
"""Modules of hc_bringup.commands; each has configure(parser) and run(arguments) -> status.

A module with COMPILES = True runs kernels itself: that these are compiled is then told. One with
HEARTBEAT = True names its steps (heartbeat.py), and each is told that lasts. Both end by a signal
also where Python does not come to answer it (last_resort.py).
"""

HUNG_UP: Final = "ended because the terminal was closed; under nohup or tmux it would have gone on"

ENTRY_POINTS: Final = "hc.commands"


class _Version(argparse.Action):
    """--version; git is asked only when somebody wants to know."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        from hc_bringup.about import version_line

        print(version_line())
        parser.exit()


class _Parser(argparse.ArgumentParser):
    """argparse, with wrong use told in one line.

    Attributes:
        words: what was typed of it and its subcommands.
    """

    words: Sequence[str] = ()

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Keep what was typed: what is not known is said at the end, and by the outermost."""
        self.words = list(sys.argv[1:] if args is None else args)
        return super().parse_known_args(args, namespace)

    def error(self, message: str) -> NoReturn:
        line = _nearer(message[:1].lower() + message[1:], self)
        self.exit(WRONG_USE, f"{self.prog}: {shortened(line)} (see {self.prog} --help)\n")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        """Refuse --option=--: argparse drops the -- and gives an empty list for the value."""
        if action.nargs is None and action.option_strings and arg_strings == ["--"]:
            raise argparse.ArgumentError(action, "expected one argument")
        return super()._get_values(action, arg_strings)


def _nearer(line: str, parser: argparse.ArgumentParser) -> str:
    """Return what argparse says with the word that was probably meant."""
    wrong = re.search(r"invalid choice: '(.*?)' \(choose from (.*)\)$", line, re.DOTALL)
    if wrong is not None:
        known = [word.strip(" '") for word in wrong[2].split(",")]
        close = difflib.get_close_matches(wrong[1], known, n=1)
        if not close:
            return line
        return f"{line[: wrong.start()]}there is no {wrong[1]!r}; did you mean {close[0]!r}?"
    if line.startswith("unrecognized arguments: "):
        word = line.split()[2]
        close = difflib.get_close_matches(word.partition("=")[0], _options(parser), n=1)
        if close and word.startswith("-"):
            return f"{line}; did you mean {close[0]}?"
    return line


def _options(parser: argparse.ArgumentParser) -> list[str]:
    """Return the long options of a parser and of the subcommands that were named."""
    options = [o for o in parser._option_string_actions if o.startswith("--")]
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction) and isinstance(parser, _Parser):
            named = next((word for word in parser.words if word in action.choices), None)
            if named is not None:
                options += _options(action.choices[named])
    return options


def _parser(command: str | None) -> argparse.ArgumentParser:
    parser = _Parser(
        prog="hc",
        description="Online characterization of soft tissue: rig, estimators, bags.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action=_Version, nargs=0, help="version and commit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", required=True)
    for name in COMMANDS:
        module = _module(name)
        sub = commands.add_parser(name, help=module.HELP, description=module.HELP)
        if command is None or name == command:
            module.configure(sub)
    if command in COMMANDS:
        return parser
    for name in _commands_of_others():
        if name == command:
            module = _module(name)
            module.configure(commands.add_parser(name, help=module.HELP, description=module.HELP))
        else:
            commands.add_parser(name, help=_help_of_other(name))
    return parser


def command_parser(command: str) -> argparse.ArgumentParser:
    """Return the parser of one command alone."""
    module = _module(command)
    parser = _Parser(prog=f"hc {command}", description=module.HELP)
    module.configure(parser)
    return parser


def _commands_of_others() -> dict[str, importlib.metadata.EntryPoint]:
    """Return the commands of other packages: entry points of the group `hc.commands`."""
    found = importlib.metadata.entry_points(group=ENTRY_POINTS)
    return {point.name: point for point in found if point.name not in COMMANDS}


def _help_of_other(command: str) -> str:
    try:
        return str(_module(command).HELP)
    except (UserError, AttributeError) as error:
        return f"[{error}]"


def _module(command: str) -> Any:
    if command not in COMMANDS:
        point = _commands_of_others()[command]
        try:
            return point.load()
        except Exception as error:
            raise UserError(
                f"the command {command} of {point.value} cannot be loaded: {error}"
            ) from error
    return importlib.import_module(f"hc_bringup.commands.{command.replace('-', '_')}")


_interrupts: list[int] = []


def on_interrupt(number: int, _frame: FrameType | None) -> None:
    """Answer SIGINT, SIGTERM and SIGHUP with a KeyboardInterrupt, and remember the signal.

    Extension modules make other errors of the exception. A second SIGTERM ends the process at once.
    A second SIGHUP means no more than the first: the shell and the kernel send one each when a
    terminal is closed, and what has been written by halves is taken away meanwhile.
    """
    _interrupts.append(number)
    last_resort.heard()
    if number == signal.SIGTERM:
        signal.signal(number, signal.SIG_DFL)
    elif number == signal.SIGHUP:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


def was_interrupted() -> bool:
    """Whether SIGINT, SIGTERM or SIGHUP has come, whatever error was made of it."""
    return bool(_interrupts)


def interrupted_status() -> int:
    """Return the exit status of a command that a signal ended, as shells tell it."""
    return 128 + (_interrupts[-1] if _interrupts else signal.SIGINT)


def hung_up() -> bool:
    """Whether the command was ended because its terminal was closed."""
    return bool(_interrupts) and _interrupts[-1] == signal.SIGHUP


def main(arguments: Sequence[str] | None = None, *, tell_waiting: bool = False) -> int:
    """Run the hc command.

    Args:
        arguments: command line without the program's name; None takes sys.argv.
        tell_waiting: whether lines on standard error say that kernels are being compiled, and what
            else takes long.

    Returns:
        Exit status: 0, 1 for a failure, 2 for wrong use.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # names of files need not be UTF-8
            make_plain(stream)
    try:
        return _run_guarded(words, tell_waiting)
    except KeyboardInterrupt:  # also one that is noticed only while the error it made is told
        return interrupted_status()


def _run_guarded(words: list[str], tell_waiting: bool) -> int:
    try:
        try:
            return _run(words, tell_waiting)
        finally:
            if tell_waiting:
                heartbeat.end()
            _flush()  # before the error line; and a full disk shows here, not when Python ends
    except UserError as error:
        return _tell(words, error)
    except UnknownInterfaceError as error:
        return _tell(words, UserError(str(error), WRONG_USE if error.misnamed else FAILURE))
    except BrokenPipeError:  # the reader of our output has seen enough: hc topic echo | head
        return 0
    except Exception as error:  # noqa: BLE001 - no traceback reaches a user, whatever it is
        if _interrupts:
            return interrupted_status()
        return _tell(words, explain(error, words))


def _complete() -> None:
    """Answer a shell that asks what the words so far can go on with (hc completion), and end."""
    import argcomplete

    from hc_bringup.completers import attach

    line = os.environ["COMP_LINE"][: int(os.environ["COMP_POINT"])]
    words = line.split()[1:] if line[-1:].isspace() else line.split()[1:-1]
    command = words[0] if words else "none yet"  # the options of one command alone are declared
    parser = _parser(command)
    attach(parser)
    argcomplete.autocomplete(parser, always_complete_options=False)


def _run(words: list[str], tell_waiting: bool) -> int:
    if "_ARGCOMPLETE" in os.environ:
        _complete()
    parser = _parser(words[0] if words else None)
    parsed, unknown = parser.parse_known_args(words)
    if unknown:
        parser.prog = f"hc {parsed.command}"
        parser.error(f"unrecognized arguments: {' '.join(unknown)}")
    try:
        os.getcwd()
    except FileNotFoundError:
        raise UserError("the folder where you are was deleted: change to another one") from None
    module = _module(parsed.command)
    has_heartbeat, compiles = (
        tell_waiting and getattr(module, name, False) for name in ("HEARTBEAT", "COMPILES")
    )
    if has_heartbeat or compiles:
        last_resort.arm(f"hc {parsed.command}")
    if has_heartbeat:
        heartbeat.begin(f"starting hc {parsed.command}")
    if compiles:
        from hc_bringup.compilation_notice import CompilationNotice

        CompilationNotice()
    from hc_bringup import standard_input

    with standard_input.kept(parsed, tell_waiting=tell_waiting and not has_heartbeat):
        return int(module.run(parsed))


def _flush() -> None:
    """Write out what was printed; what cannot be written is dropped, so that Python's end is quiet.

    Raises:
        BrokenPipeError: if nobody reads it any more.
        UserError: if it cannot be written.
    """
    try:
        sys.stdout.flush()
    except OSError as error:
        standard_output.drop()
        if isinstance(error, BrokenPipeError):
            raise
        raise standard_output.unwritable(error) from error


def _tell(words: list[str], error: UserError) -> int:
    output = getattr(error, "output", "")
    if output:
        sys.stderr.write(f"{output}\n")
    command = words[0] if words and words[0] in COMMANDS else ""
    line = wrapped(f"{f'hc {command}'.strip()}: {error}", stream=sys.stderr)
    sys.stderr.write(f"{line}\n")
    return error.status


if __name__ == "__main__":
    sys.exit(main())
