"""hc new filter NAME: a package of one's own with a filter in it that works, and its tests."""

from __future__ import annotations

import argparse
import importlib.util
import keyword
import shlex
import shutil
import sys
from pathlib import Path

from hc_bringup.errors import WRONG_USE, UserError

HELP = "make a package with a filter of your own, that every command then knows"
_TEMPLATES = Path(__file__).parent.parent / "templates" / "filter"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    kinds = parser.add_subparsers(dest="kind", metavar="KIND", required=True)
    made = kinds.add_parser("filter", help="a filter on the state spaces of the suite")
    made.add_argument("name", metavar="NAME", help="of the filter and the package: my_filter, say")
    made.add_argument(
        "-o", "--output", metavar="DIR", help="folder to make (default: NAME, in this folder)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_estimator import available_filters

    name = arguments.name
    if not (name.isidentifier() and name.isascii() and name.islower()) or keyword.iskeyword(name):
        raise UserError(f"{name!r} is no name for a package: letters a-z, digits and _", WRONG_USE)
    if name in available_filters():
        raise UserError(f"there is a filter {name} already", WRONG_USE)
    if importlib.util.find_spec(name) is not None:
        raise UserError(f"there is a Python module {name} already: choose another name", WRONG_USE)
    folder = Path(arguments.output or name)
    if folder.exists():
        raise UserError(f"{folder} exists already", WRONG_USE)
    try:
        for template in sorted(_TEMPLATES.rglob("*.txt")):
            inside = str(template.relative_to(_TEMPLATES)).removesuffix(".txt")
            target = folder / inside.replace("NAME", name)
            target.parent.mkdir(parents=True, exist_ok=True)
            text = template.read_text(encoding="utf-8").replace("NAME", name)
            target.write_text(text, encoding="utf-8")
    except OSError as error:
        shutil.rmtree(folder, ignore_errors=True)  # half a package: it was not there before
        raise UserError(f"cannot write {folder}: {error.strerror}") from error
    python = shlex.quote(sys.executable)
    print(f"{folder} is made. Install it into this environment, and every command knows it:")
    print(f"  {python} -m pip install --no-deps -e {shlex.quote(str(folder))}")
    print(f"  hc estimate RECORDING --filter {name}")
    print(f"  {python} -m pytest {shlex.quote(str(folder))}")
    print("Its settings are in one record with those of the others: all are compiled anew, once.")
    return 0
