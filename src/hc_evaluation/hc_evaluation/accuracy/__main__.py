"""The accuracy experiments for any estimator, also one that is not yet a filter of hc_estimator.

    python -m hc_evaluation.accuracy scan separation --seeds 4
    python -m hc_evaluation.accuracy delay --filter ukf --param noise_adaptation=differences
    python -m hc_evaluation.accuracy scan --candidate my_filter.py:make --param memory=0.4

A candidate's function makes an object with run(time_s, displacement_mm, force_n) (see `candidate`).
Its seeds are others than those that are reported, so that settings can be chosen with it.
`hc bench accuracy` is the same for the default filter, with progress, pictures and documents.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any

import yaml

from hc_evaluation.accuracy.bench import CHOOSING_SEED
from hc_evaluation.accuracy.measure import Setup
from hc_evaluation.accuracy.run import EXPERIMENTS, checked, run_accuracy
from hc_evaluation.accuracy.table import text_table


def main(arguments: list[str] | None = None) -> int:
    """Run the experiments and print their tables; 1 if a target is not met, 2 for wrong use."""
    parser = argparse.ArgumentParser(prog="python -m hc_evaluation.accuracy")
    parser.add_argument("names", nargs="*", metavar="EXPERIMENT", help=", ".join(EXPERIMENTS))
    parser.add_argument("--seeds", type=int, default=4, metavar="N", help="noise seeds (4)")
    parser.add_argument(
        "--first-seed", type=int, default=CHOOSING_SEED, metavar="N", help="(%(default)s)"
    )
    parser.add_argument("--filter", default=Setup().filter, help="of hc_estimator")
    parser.add_argument("--candidate", default="", metavar="FILE.py:NAME", help="instead of it")
    parser.add_argument(
        "--param", action="append", default=[], metavar="NAME=VALUE", help="may be repeated"
    )
    options = parser.parse_args(arguments)
    parameters: dict[str, Any] = {}
    for text in options.param:
        name, _, value = text.partition("=")
        parameters[name] = yaml.safe_load(value)
    setup = Setup(options.filter, parameters, options.candidate)
    try:  # what was asked for; an error from within an experiment keeps its traceback
        checked(options.names, options.seeds)
        setup.create()
    except ValueError as error:
        parser.error(str(error))
    result = run_accuracy(options.names, options.seeds, setup=setup, first_seed=options.first_seed)
    sys.stdout.write(text_table(result) + "\n")
    targets = [t for e in result["experiments"].values() for t in e.get("targets", [])]
    return 0 if all(target["met"] for target in targets) else 1


if __name__ == "__main__":
    sys.exit(main())
