"""hc load: the estimator's service ~/load, with its answer."""

from __future__ import annotations

import argparse

HELP = "let the running estimator go on from what was saved"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from hc_bringup.service_calls import add_node_option

    add_node_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.service_calls import trigger

    return trigger(arguments.node, "load")
