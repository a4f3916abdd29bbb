"""hc reproduce: the experiments of the three papers, beside what they printed."""

from __future__ import annotations

import argparse
from pathlib import Path

from hc_bringup.about import origin_line
from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import natural

HELP = "run the papers' experiments and write tables and figures beside the published ones"
COMPILES = True
HEARTBEAT = True


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("names", nargs="*", metavar="EXPERIMENT", help="some of them (all)")
    parser.add_argument("--list", action="store_true", help="print the names of the experiments")
    parser.add_argument("--seeds", type=natural, default=100, metavar="N", help="runs each (100)")
    parser.add_argument("--quick", action="store_true", help="few runs, for a first look")
    parser.add_argument("--workers", type=natural, default=2, metavar="N", help="processes (2)")
    parser.add_argument("-o", "--output", metavar="DIR", help="folder of page, tables, figures")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.progress import counted_bar
    from hc_evaluation.reproduction import (
        ReproductionError,
        available_experiments,
        run_reproduction,
    )

    if arguments.list:
        print("\n".join(available_experiments()))
        return 0
    if arguments.output is None:
        raise UserError("give the folder for page, tables and figures with -o", WRONG_USE)
    try:
        with counted_bar() as progress:
            result = run_reproduction(
                arguments.names,
                seeds=arguments.seeds,
                quick=arguments.quick,
                output=Path(arguments.output),
                workers=arguments.workers,
                progress=progress,
                origin=origin_line(),
            )
    except ReproductionError as error:
        raise UserError(str(error), WRONG_USE) from error
    print("\n".join(str(file) for file in result.files))
    return 0
