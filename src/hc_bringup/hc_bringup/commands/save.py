"""hc save: the estimator's service ~/save, with its answer."""

from __future__ import annotations

import argparse

HELP = "save what the running estimator knows, in its state.folder"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from hc_bringup.service_calls import add_node_option

    add_node_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.service_calls import trigger

    return trigger(arguments.node, "save")
