"""hc batch: every recording through the estimator, on this machine or on a cluster."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from hc_bringup import cli, heartbeat, last_resort, recording_input
from hc_bringup.command_words import option_words, reading_words
from hc_bringup.commands.contacts import add_rule_options, add_sites_option
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import natural
from hc_bringup.terminal.numbers import counted
from hc_bringup.wrapping import wrapped

HELP = "run thousands of recordings through the estimator into tables; resumes, sweeps, clusters"
COMPILES = True
HEARTBEAT = True
MOST_WORKERS = 1024
MOST_REASONS = 5
"""Of recordings without a result that are said; the table has all."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    from hc_bringup.batch.variants import sweep

    parser.add_argument(
        "patterns",
        nargs="+",
        metavar="PATTERN",
        help="recordings, folders of them, or patterns in quotes ('day*/**/*.csv')",
    )
    parser.add_argument("-o", "--output", required=True, metavar="DIR", help="folder of results")
    parser.add_argument(
        "-j",
        "--jobs",
        type=natural,
        default=0,
        metavar="N",
        help="processes (default: as many as processors)",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="keep the results in DIR that are of the same content, settings and software",
    )
    recording_input.add_filter_options(parser)
    parser.add_argument(
        "--sweep",
        type=sweep,
        action="append",
        default=[],
        metavar="NAME=V,V,...",
        help="run each value: of filter, state_space, contact_model or a setting; several make "
        "all combinations",
    )
    parser.add_argument(
        "--estimates",
        nargs="?",
        const="csv",
        default="",
        choices=("csv", "parquet"),
        help="write every estimate too, in a folder for each recording (default: csv)",
    )
    cluster = parser.add_mutually_exclusive_group()
    cluster.add_argument(
        "--scheduler", metavar="ADDRESS", help="run on a Dask cluster, tcp://host:8786 say"
    )
    cluster.add_argument(
        "--local-cluster", type=natural, metavar="N", help="start a Dask cluster of N processes"
    )
    add_rule_options(parser)
    add_sites_option(parser, of_many=True)
    recording_input.add_reading_options(parser)
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def _what_to_do(others: Sequence[Path]) -> str:
    """Say how files of other endings are taken; some are not before they are unpacked."""
    from hc_logger.compressions import BY_SUFFIX, COMPRESSIONS

    packed = {one.suffix: one.unpack for one in COMPRESSIONS if one.suffix not in BY_SUFFIX}
    readable = [path.suffix for path in others if path.suffix not in packed]
    ways = [f"others by a pattern in quotes: '**/*{suffix}'" for suffix in readable[:1]]
    there = {path.suffix for path in others}
    ways += [f"{end} when it is unpacked ({way})" for end, way in packed.items() if end in there]
    return ", ".join(ways)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.batch.campaign import Campaign
    from hc_bringup.batch.engines import SchedulerGoneError
    from hc_bringup.batch.sources import find_recordings, names_of
    from hc_bringup.batch.variants import variants
    from hc_bringup.batch.work import ResultError, WrongSoftwareError
    from hc_bringup.estimate_table import has_pyarrow
    from hc_bringup.progress import long_bar

    for name, count in (("-j", arguments.jobs), ("--local-cluster", arguments.local_cluster or 1)):
        if count > MOST_WORKERS:
            raise UserError(f"{name} {count} is more than {MOST_WORKERS}", WRONG_USE)
    if arguments.local_cluster == 0:
        raise UserError("--local-cluster 0 works nothing: give 1 or more", WRONG_USE)
    if arguments.jobs and (arguments.scheduler or arguments.local_cluster):
        raise UserError("-j is for this machine alone: leave it away with a cluster", WRONG_USE)
    if arguments.estimates == "parquet" and not has_pyarrow():
        raise UserError("--estimates parquet needs pyarrow: pip install hc-suite[parquet]")
    recording_input.check(arguments)
    folder = Path(os.path.abspath(arguments.output))
    paths, others = find_recordings(arguments.patterns, folder)
    if others:
        names = ", ".join(sorted({path.name for path in others})[:3])
        line = (
            f"left out for their ending: {len(others)} (such as {names}); of a folder .csv, .tsv, "
            f".mcap and bags are taken, {_what_to_do(others)}"
        )
        print(wrapped(line, stream=sys.stderr), file=sys.stderr, flush=True)
    ways = variants(arguments, arguments.sweep)
    campaign = Campaign(
        folder,
        paths,
        names_of(paths),
        ways,
        arguments,
        arguments.estimates,
        arguments.resume,
        command_line(arguments),
        reading_line(arguments),
    )
    start = time.monotonic()
    interrupted, gone = False, ""
    with contextlib.ExitStack() as held:
        try:
            with _engine(arguments) as (engine, workers):
                held.enter_context(campaign.alone())
                heartbeat.doing(f"looking at {len(paths)} recordings")
                campaign.prepare()
                for way in ways[:1] if workers > 1 else ():
                    heartbeat.doing("loading the filter")
                    _warm_up(way)
                last_resort.disarm()  # what is done is gathered when a signal comes
                try:
                    with long_bar("results") as tell:
                        campaign.run(engine, campaign.tasks(workers), tell)
                except KeyboardInterrupt:
                    interrupted = True
                except SchedulerGoneError as error:
                    gone = str(error)
            heartbeat.doing("gathering the tables")
            files = _gathered(campaign)
            heartbeat.nothing()
        except ResultError as error:
            raise UserError(f"{error}: what is done is kept, --resume goes on") from error
        except WrongSoftwareError as error:
            raise UserError(
                "a worker runs other software than this: start the workers from the same checkout"
            ) from error
        _tell(campaign, files, time.monotonic() - start, arguments)
    if gone:
        raise UserError(f"{gone}: what is done is kept, --resume goes on")
    if interrupted:
        return cli.interrupted_status()
    return FAILURE if _without_any(campaign) else 0


def _without_any(campaign: Any) -> bool:
    """Whether not one recording gave a result: a script must not take that for a study."""
    return campaign.done > 0 and all(done.result["reason"] for done in campaign.results())


def _gathered(campaign: Any) -> list[str]:
    """Write the tables; returns the names of the files.

    Raises:
        UserError: if a signal came meanwhile.
        ResultError: if one cannot be written.
    """
    try:
        files: list[str] = campaign.gather()
    except KeyboardInterrupt:
        raise UserError(
            f"ended while the tables were gathered: {campaign.done} of {campaign.total} results "
            "are kept, --resume goes on",
            cli.interrupted_status(),
        ) from None
    return files


def _warm_up(way: Any) -> None:
    """Compile once what all workers load from the cache."""
    from hc_bringup.commands.estimate import make_estimator

    make_estimator(way.arguments).warm_up()


@contextlib.contextmanager
def _engine(arguments: argparse.Namespace) -> Iterator[tuple[Any, int]]:
    """Yield what does the tasks, and how many processes share them."""
    from hc_bringup.batch import engines

    if arguments.scheduler is None and arguments.local_cluster is None:
        workers = arguments.jobs or len(os.sched_getaffinity(0))
        yield lambda tasks: engines.here(tasks, workers), workers
        return
    with engines.dask_client(arguments.scheduler, arguments.local_cluster or 0) as client:
        workers = max(1, sum(client.nthreads().values()))
        yield lambda tasks: engines.distributed_over(tasks, client), workers


def command_line(arguments: argparse.Namespace) -> list[str]:
    """Return the command line that makes these results again, on however many processes."""
    words = ["hc", "batch", *arguments.patterns]
    for name in ("filter", "state_space", "contact_model"):
        words += option_words(arguments, name)
    for name, value in arguments.param:
        words += ["--param", f"{name}={value}"]
    for name, values in arguments.sweep:
        words += ["--sweep", f"{name}={','.join(map(str, values))}"]
    words += option_words(arguments, "estimates", "") + reading_line(arguments)
    return [*words, "-o", "DIR"]


def reading_line(arguments: argparse.Namespace) -> list[str]:
    """Return the words that say how recordings are read and what counts as a contact."""
    words = [*option_words(arguments, "tip"), *reading_words(arguments)]
    words += ["--sites"] * arguments.sites
    for name, usual in (
        ("tip_axes", "xy"),
        ("minimum_depth", 0.0),
        ("minimum_force", 0.0),
        ("minimum_duration", 0.05),
        ("release", 0.02),
    ):
        words += option_words(arguments, name, usual)
    return words


def _tell(
    campaign: Any,
    files: list[str],
    seconds: float,
    arguments: argparse.Namespace,
) -> None:
    from hc_bringup.summary import to_json

    failures: dict[str, list[tuple[str, str]]] = {}
    contacts = 0
    for done in campaign.results():
        if done.result["reason"]:
            failures.setdefault(done.name, []).append((done.variant.label, done.result["reason"]))
        contacts += done.result["recording"].get("contacts", 0)
    without = sum(map(len, failures.values()))
    summary = {
        "recordings": len(campaign.paths),
        "variants": len(campaign.variants),
        "results": campaign.done - without,
        "made": campaign.made,
        "kept": campaign.done - without - campaign.made,
        "without_result": without,
        "contacts": contacts,
        "copies": campaign.copies(),
        "complete": campaign.complete,
        "seconds": seconds,
        "written": [str(Path(arguments.output) / name) for name in files],
    }
    if arguments.json:
        print(to_json(summary))
        return
    variants = f" through {len(campaign.variants)} variants" if len(campaign.variants) > 1 else ""
    print(
        f"{counted(len(campaign.paths), 'recording')}{variants}: "
        f"{counted(campaign.made, 'result')} made, {summary['kept']} kept, "
        f"{without} without a result, {counted(contacts, 'contact')}, {seconds:.1f} s"
    )
    lines = [
        line for name, of in failures.items() for line in _why(name, of, len(campaign.variants))
    ]
    for line in lines[:MOST_REASONS]:
        print(f"without a result: {line}")
    if len(lines) > MOST_REASONS:
        print(f"and {len(lines) - MOST_REASONS} more without a result: see recordings.csv")
    if copies := campaign.copies():
        print(_about_copies(copies))
    if not campaign.complete:
        print(f"ended early with {campaign.done} of {campaign.total}: --resume goes on")
    for name in summary["written"]:
        print(f"written: {name}")


def _about_copies(copies: list[list[str]]) -> str:
    """Say which recordings a mean over the table would count more than once."""
    named = "; ".join(" = ".join(names[:MOST_REASONS]) for names in copies[:MOST_REASONS])
    more = " ..." if len(copies) > MOST_REASONS or max(map(len, copies)) > MOST_REASONS else ""
    again = counted(sum(len(names) - 1 for names in copies), "recording")
    return f"{again} with the content of another, and counted each: {named}{more}"


def _why(name: str, failures: Sequence[tuple[str, str]], variants: int) -> list[str]:
    """Return why a recording has no result: one line if that is so of every variant alike."""
    reasons = {reason for _, reason in failures}
    if len(failures) == variants and len(reasons) == 1:
        return [f"{name}: {reason}" for reason in reasons]
    return [f"{name}, {label}: {reason}" for label, reason in failures]
