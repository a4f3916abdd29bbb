"""hc bench: the measurements behind every figure in the documents."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hc_bringup import heartbeat
from hc_bringup.about import origin_line
from hc_bringup.errors import FAILURE, WRONG_USE, UserError
from hc_bringup.options import natural, positive
from hc_msgs_py.realtime import DEFAULT_PRIORITY

HELP = "measure speed, accuracy, bags, endurance, viewers: the figures of the documents"
COMPILES = True
HEARTBEAT = True
_DOCUMENT = "write tables into this document and the pages of its evidence/, CSV there"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    commands = parser.add_subparsers(dest="action", metavar="WHAT", required=True)
    speed = commands.add_parser("speed", help="microseconds a sample, against others")
    arrays = commands.add_parser("arrays", help="channels at 1 kHz that one core allows")
    arrays.add_argument("--channels", type=natural, default=256, metavar="N", help="how many (256)")
    accuracy = commands.add_parser("accuracy", help="errors against truth and bounds")
    accuracy.add_argument("names", nargs="*", metavar="EXPERIMENT", help="some of them (all)")
    accuracy.add_argument("--seeds", type=natural, metavar="N", help="runs of each scenario (50)")
    accuracy.add_argument("--quick", action="store_true", help="few seeds, for a first look")
    bags = commands.add_parser("bags", help="recorder, player, bag files")
    bags.add_argument("--duration", type=positive, default=20.0, metavar="S", help="of each part")
    soak = commands.add_parser(
        "soak", help="long runs under random reconfiguration, with viewers, with nodes killed"
    )
    soak.add_argument(
        "--minutes", type=positive, default=8.0, metavar="N", help="how long, both halves (8)"
    )
    halves = soak.add_mutually_exclusive_group()
    halves.add_argument(
        "--without-kills", action="store_true", help="leave out the half in which nodes are killed"
    )
    halves.add_argument(
        "--only-kills", action="store_true", help="leave out the half in which none is"
    )
    soak.add_argument("--seed", type=natural, default=0, metavar="N", help="of the changes")
    teleoperation = commands.add_parser(
        "teleoperation", help="four ways to feed force back, over delay, with jitter and loss"
    )
    teleoperation.add_argument(
        "--quick", action="store_true", help="one seed, the default filter only"
    )
    teleoperation.add_argument(
        "--document", metavar="FILE.md", help=f"{_DOCUMENT}, pictures beside"
    )
    effort = commands.add_parser(
        "effort", help="teleoperation without a force sensor, by noise and friction"
    )
    effort.add_argument("--quick", action="store_true", help="one seed")
    latency = commands.add_parser(
        "latency", help="stamp to estimate as distributions: by rate, subscribers, idle and loaded"
    )
    latency.add_argument(
        "--duration", type=positive, default=60.0, metavar="S", help="of each case (60)"
    )
    latency.add_argument(
        "--rate",
        type=positive,
        action="append",
        metavar="HZ",
        help="samples a second, may be given several times (1000, 2000, 4000, 7000)",
    )
    latency.add_argument(
        "--subscribers",
        type=natural,
        action="append",
        metavar="N",
        help="of hc/estimate beside the recorder, may be given several times (1, 4)",
    )
    latency.add_argument(
        "--machine",
        choices=("idle", "loaded", "both"),
        default="both",
        help="loaded: a compiler runs on the last processor (both)",
    )
    latency.add_argument(
        "--together",
        type=positive,
        metavar="HZ",
        help="messages a second at most: samples of higher rates travel in arrays",
    )
    latency.add_argument("--filter", metavar="F", help="filter of the estimator")
    latency.add_argument(
        "--realtime",
        nargs="?",
        type=int,
        const=DEFAULT_PRIORITY,
        metavar="PRIORITY",
        help="real-time scheduling, as of hc run",
    )
    latency.add_argument("--picture", metavar="FILE", help="draw the distributions (.png, .svg)")
    impedance = commands.add_parser(
        "impedance", help="the slave's controller that adapts to the estimate, beside fixed ones"
    )
    impedance.add_argument("--quick", action="store_true", help="one seed")
    for command in (effort, impedance):
        command.add_argument("--document", metavar="FILE.md", help=_DOCUMENT)
    viewers = commands.add_parser(
        "viewers", help="what 0, 1 and 5 viewers of the live page cost, one of them stalled"
    )
    viewers.add_argument(
        "--duration", type=positive, default=30.0, metavar="S", help="of each (30)"
    )
    accuracy.add_argument("--document", metavar="FILE.md", help=f"{_DOCUMENT}, pictures beside")
    measured = (
        speed,
        arrays,
        latency,
        accuracy,
        bags,
        soak,
        viewers,
        teleoperation,
        effort,
        impedance,
    )
    for command in measured:
        command.add_argument("--json", action="store_true", help="print the figures as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    actions = {
        "speed": _speed,
        "arrays": _arrays,
        "latency": _latency,
        "accuracy": _accuracy,
        "bags": _bags,
        "soak": _soak,
        "viewers": _viewers,
        "teleoperation": _teleoperation,
        "effort": _effort,
        "impedance": _impedance,
    }
    heartbeat.nothing()  # what lasts names itself from here on
    return actions[arguments.action](arguments)


def _speed(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_evaluation.speed import run_speed

    try:
        with progress_bar("speed") as progress:
            figures = run_speed(progress)
    except ImportError as error:
        raise UserError("needs filterpy, which ./hc installs: pip install filterpy") from error
    _show(figures, arguments.json)
    return 0


def _arrays(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_evaluation.array_speed import run_array_speed

    if not 1 <= arguments.channels <= 4096:
        raise UserError(f"--channels {arguments.channels} is not from 1 to 4096", WRONG_USE)
    with progress_bar("arrays") as progress:
        figures = run_array_speed(arguments.channels, progress=progress)
    _show(figures, arguments.json)
    return 0


def _latency(arguments: argparse.Namespace) -> int:
    from hc_bringup.bench_latency import RATES_HZ, SUBSCRIBERS, bench_latency, draw, text_table
    from hc_bringup.commands.run import ask_for_realtime
    from hc_bringup.live import Display
    from hc_bringup.summary import to_json

    for number in arguments.subscribers or ():
        if not 1 <= number <= 64:
            raise UserError(f"--subscribers {number} is not from 1 to 64", WRONG_USE)
    picture = Path(arguments.picture) if arguments.picture is not None else None
    if picture is not None and not (
        picture.suffix in (".png", ".svg") and picture.absolute().parent.is_dir()
    ):
        raise UserError(
            f"--picture {picture}: give a .png or .svg in a folder that exists", WRONG_USE
        )
    ask_for_realtime(arguments.realtime, None)
    loads = {"idle": (False,), "loaded": (True,), "both": (False, True)}[arguments.machine]
    with Display(enabled=not arguments.json, with_keys=False, with_estimates=False) as display:
        cases = bench_latency(
            arguments.duration,
            arguments.rate or RATES_HZ,
            arguments.subscribers or SUBSCRIBERS,
            loads,
            filter_name=arguments.filter,
            together_hz=arguments.together,
            show=display.show,
        )
    if picture is not None:
        draw(cases, picture)
    for case in cases:
        del case["latencies_s"]
    print(to_json({"cases": cases}) if arguments.json else text_table(cases))
    return 0


def _accuracy(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import counted_bar
    from hc_bringup.summary import to_json
    from hc_evaluation.accuracy.pictures import write_pictures
    from hc_evaluation.accuracy.run import EXPERIMENTS, run_accuracy
    from hc_evaluation.accuracy.table import markdown_tables, text_table, write_tables
    from hc_evaluation.workers import WorkerDiedError

    document = Path(arguments.document) if arguments.document is not None else None
    if document is not None and not document.is_file():
        raise UserError(f"there is no document {document}", WRONG_USE)
    try:
        with counted_bar() as progress:
            result = run_accuracy(
                arguments.names, arguments.seeds, quick=arguments.quick, progress=progress
            )
            short = [n for n in result["experiments"] if not EXPERIMENTS[n].by_name_only]
            once = run_accuracy(short, 1, progress=progress) if document and short else None
    except ValueError as error:
        raise UserError(str(error), WRONG_USE) from error
    except WorkerDiedError as error:
        raise UserError(str(error)) from error
    if document is not None:
        write_tables(result, document, origin_line())
        for name, experiment in once["experiments"].items() if once else ():
            _keep(document, {f"accuracy {name}": markdown_tables(name, experiment)[""]})
        pictures = document.parent / "pictures"
        pictures.mkdir(exist_ok=True)
        write_pictures(result, pictures)
    print(to_json(result) if arguments.json else text_table(result))
    targets = [t for e in result["experiments"].values() for t in e.get("targets", [])]
    return 0 if all(target["met"] for target in targets) else FAILURE


def _bags(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import status_line
    from hc_logger.errors import BagError
    from hc_logger.ros.bench import bench_bags

    try:
        with status_line() as tell:
            figures = bench_bags(arguments.duration, progress=tell)
    except BagError as error:
        raise UserError(str(error)) from error
    _show(figures, arguments.json)
    return 0


def _soak(arguments: argparse.Namespace) -> int:
    from hc_bringup.live import Display
    from hc_bringup.soak import run_soak
    from hc_bringup.soak_kills import run_kills

    halves = {"steady": run_soak, "kills": run_kills}
    if arguments.without_kills:
        del halves["kills"]
    if arguments.only_kills:
        del halves["steady"]
    reports: dict[str, Any] = {}
    for name, half in halves.items():
        with Display(enabled=True, with_keys=False) as display:
            reports[name] = half(
                arguments.minutes / len(halves), seed=arguments.seed, show=display.show
            )
    _show({name: report.as_dict() for name, report in reports.items()}, arguments.json)
    return 0 if all(report.passed for report in reports.values()) else FAILURE


def _document(arguments: argparse.Namespace, *names: str) -> Path | None:
    """The document that tables are to be written into, if one was named; it has their places."""
    from hc_evaluation.places import check_places

    if arguments.document is None:
        return None
    document = Path(arguments.document)
    try:
        check_places(document, *names)
    except (OSError, ValueError) as error:
        raise UserError(f"cannot write into {document}: {error}", WRONG_USE) from error
    return document


def _said(result: Mapping[str, Any]) -> str:
    """How tables were measured."""
    seeds = result["seeds"]
    return f"{seeds} seed{'s' if seeds > 1 else ''}. {origin_line()}"


def _fill(document: Path, tables: Mapping[str, str], said: str) -> None:
    """Write tables into their places."""
    from hc_evaluation.places import write_place

    for name, table in tables.items():
        write_place(document, name, said, {"": table})


def _keep(document: Path, tables: Mapping[str, str]) -> None:
    """Keep what one seed gave: a test runs it again and tells when the page has grown too old."""
    from hc_evaluation.places import keep_first_seed

    for name, table in tables.items():
        keep_first_seed(document, name, f"1 seed. {origin_line()}", table)


def _teleoperation(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import counted_bar
    from hc_bringup.summary import to_json
    from hc_evaluation.teleoperation.bench import run_teleoperation
    from hc_evaluation.teleoperation.pictures import write_pictures
    from hc_evaluation.teleoperation.table import markdown_table, text_table

    document = _document(arguments, "teleoperation")
    with counted_bar() as progress:
        result = run_teleoperation(quick=arguments.quick, progress=progress)
    if document is not None:
        _fill(document, {"teleoperation": markdown_table(result)}, _said(result))
        once = run_teleoperation(quick=True)
        _keep(document, {"teleoperation": markdown_table(once)})
        pictures = document.parent / "pictures"
        pictures.mkdir(exist_ok=True)
        write_pictures(result, pictures)
    print(to_json(result) if arguments.json else text_table(result))
    return 0


def _effort(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_bringup.summary import to_json
    from hc_evaluation.teleoperation.effort import PLACES, markdown_tables, run_effort, text_tables

    document = _document(arguments, *PLACES)
    with progress_bar("effort") as progress:
        result = run_effort(quick=arguments.quick, progress=progress)
    if document is not None:
        _fill(document, markdown_tables(result), _said(result))
        _keep(document, markdown_tables(run_effort(quick=True)))
    print(to_json(result) if arguments.json else text_tables(result))
    return 0


def _impedance(arguments: argparse.Namespace) -> int:
    from hc_bringup.progress import progress_bar
    from hc_bringup.summary import to_json
    from hc_evaluation.teleoperation.impedance import run_impedance, text_table

    document = _document(arguments, "impedance")
    with progress_bar("impedance") as progress:
        result = run_impedance(quick=arguments.quick, progress=progress)
    if document is not None:
        _fill(document, {"impedance": text_table(result)}, _said(result))
        _keep(document, {"impedance": text_table(run_impedance(quick=True))})
    print(to_json(result) if arguments.json else text_table(result))
    return 0


def _viewers(arguments: argparse.Namespace) -> int:
    from hc_bringup.bench_viewers import bench_viewers
    from hc_bringup.live import Display

    with Display(enabled=True, with_keys=False) as display:
        figures = bench_viewers(arguments.duration, show=display.show)
    _show(figures, arguments.json)
    return 0


def _show(figures: Mapping[str, Any], as_json: bool) -> None:
    from hc_bringup.summary import to_json

    print(to_json(dict(figures)) if as_json else "\n".join(_lines(figures)))


def _lines(figures: Mapping[str, Any], indent: str = "") -> list[str]:
    lines = []
    for name, value in figures.items():
        if isinstance(value, Mapping):
            lines += [f"{indent}{name}:", *_lines(value, indent + "  ")]
        else:
            lines.append(f"{indent}{name}: {_text(value)}")
    return lines


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
