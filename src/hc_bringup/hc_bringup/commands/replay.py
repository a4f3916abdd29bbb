"""hc replay: publishes a bag again with its timing, beside a fresh estimator if asked."""

from __future__ import annotations

import argparse
import sys
import termios
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import assignment, each_once, positive, seconds

HEARTBEAT = True
HELP = "publish a bag again with its timing, beside a fresh estimator if asked"
DERIVED_TOPICS = ["/hc/*", "/diagnostics", "/rosout", "/parameter_events"]
"""Topics of a bag that a fresh estimator publishes itself, and the log of the recorded run."""


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("input", metavar="BAG", help="bag folder or .mcap file")
    parser.add_argument(
        "--rate", type=positive, default=1.0, metavar="R", help="recorded seconds per second"
    )
    parser.add_argument("--loop", action="store_true", help="start again at the end, until Ctrl-C")
    parser.add_argument(
        "--start",
        type=seconds,
        default=0.0,
        metavar="S",
        help="begin S s after the first sample (default: with what lies before it, too)",
    )
    parser.add_argument(
        "--duration",
        type=seconds,
        default=0.0,
        metavar="S",
        help="end S s after that, or after the first sample (0: at the end of the bag)",
    )
    parser.add_argument("--estimator", action="store_true", help="start a fresh estimator beside")
    parser.add_argument("--filter", metavar="F", help="the same, with this filter")
    parser.add_argument("--state-space", metavar="S", help="the same, with this state space")
    parser.add_argument(
        "--param",
        type=assignment,
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="the same, with this setting; may be given several times",
    )
    parser.add_argument("--bag", metavar="DIR", help="record the replay to a new bag")
    parser.add_argument("--headless", action="store_true", help="no live display")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_bringup.conclusion import conclude, naming_bag
    from hc_bringup.live import Display
    from hc_bringup.runner import Runner

    plan, bag = _plan(arguments)
    if any(node.terminal for node in plan.nodes):
        print("keys: space pauses, right plays the next message, up and down change the rate")
    with (
        naming_bag(bag, arguments.bag),
        terminal_restored(),
        Display(enabled=not arguments.headless, with_latency=False, with_keys=False) as display,
    ):
        state = Runner(plan, display.show, with_truth=display.shows_truth).run()
    # Stamps are those of the recording, so there is no latency to speak of.
    names = [node.name for node in plan.nodes]
    conclude(state, names, bag, as_json=arguments.json, with_latency=False)
    return 0


@contextmanager
def terminal_restored() -> Iterator[None]:
    """Give the terminal its mode back, even if the player that read its keys was killed."""
    if not sys.stdin.isatty():
        yield
        return
    mode = termios.tcgetattr(sys.stdin)
    try:
        yield
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, mode)


def _plan(arguments: argparse.Namespace) -> tuple[Any, Path | None]:
    from hc_bringup.array_messages import estimator_settings
    from hc_bringup.commands.run import file_parameters, new_bag_folder
    from hc_bringup.paths import config_folder
    from hc_bringup.plan import NodePlan, RunPlan
    from hc_bringup.taken_off_live import replayed_lines
    from hc_estimator.ros.node_settings import LARGEST_BACKLOG
    from hc_logger.csv_open import is_text
    from hc_logger.errors import BagError
    from hc_logger.other_files import check_there
    from hc_logger.type_names import SAMPLE_TYPE, SAMPLES_TYPE
    from hc_msgs_py.topics import ESTIMATE, ESTIMATES, SAMPLE, SAMPLES

    source = Path(arguments.input).absolute()
    try:
        check_there(Path(arguments.input))
    except BagError as error:
        raise UserError(str(error), WRONG_USE) from error
    if is_text(source) and source.is_file():
        raise UserError(
            f"{arguments.input} is a table in text: make a bag of it first with hc bag convert",
            WRONG_USE,
        )
    chosen = ((name, getattr(arguments, name)) for name in ("filter", "state_space"))
    options = [(name, value) for name, value in chosen if value is not None]
    settings = each_once([*options, *arguments.param], "--param")
    with_estimator = arguments.estimator or bool(settings)
    file = config_folder() / "estimator.yaml"
    sensors = _sensor_topics(settings)
    kinds, samples, usual = _look_into(source, alone=with_estimator and not sensors)
    if with_estimator and not sensors and kinds.isdisjoint((SAMPLE_TYPE, SAMPLES_TYPE)):
        _refuse_without_samples(arguments.input)
    _check_topics(arguments.input, source, sensors)
    if with_estimator and not sensors:
        try:
            space = samples.removesuffix(usual) if usual else ""
            lines = replayed_lines(source, settings, space)
        except BagError as error:
            raise UserError(str(error)) from error
        for line in lines:
            print(f"{arguments.input}: {line}", file=sys.stderr)
    # The player plays either; what an estimator makes of sensors are single ones.
    arrays = not sensors and SAMPLES_TYPE in kinds and SAMPLE_TYPE not in kinds
    if with_estimator and arrays:
        estimator = NodePlan("estimator", "", parameter_files=(file,), parameters=settings)
        settings |= estimator_settings(file_parameters(estimator) | settings)
    bag = new_bag_folder(arguments.bag) if arguments.bag is not None else None
    keyboard = sys.stdin.isatty() and not (arguments.headless or arguments.json)
    listeners = int(with_estimator) + int(bag is not None)
    nodes = [
        NodePlan(
            "player",
            "hc_logger.player_node",
            parameters={
                "bag": str(source),
                "rate": arguments.rate,
                "loop": arguments.loop,
                "start_offset": arguments.start,
                "duration": arguments.duration,
                "exclude": (
                    _derived(samples, usual, with_samples=bool(sensors)) if with_estimator else [""]
                ),
                "expected_topics": list(sensors.values()) or [""],
                "remap": [f"{samples}:={usual}" if usual else ""],
                "start_paused": True,
                "exit_when_done": True,
                "expected_sample_subscribers": listeners,
                "keyboard": keyboard,
            },
            source=True,
            terminal=keyboard,
        )
    ]
    if with_estimator:
        # Nobody acts on these estimates: on a busy machine they come late rather than not at all.
        waiting = {"input.maximum_backlog": LARGEST_BACKLOG}
        parameters = {**waiting, **settings, "expected_sample_publishers": 1}
        parameters["expected_estimate_subscribers"] = 1 + int(bag is not None)
        if sensors:
            parameters["expected_sample_subscribers"] = int(bag is not None)
        nodes.append(
            NodePlan(
                "estimator",
                "hc_estimator.node",
                parameter_files=(file,),
                parameters=parameters,
            )
        )
    if bag is not None:
        topics = []
        if with_estimator or not kinds.isdisjoint((SAMPLE_TYPE, SAMPLES_TYPE)):
            topics.append(SAMPLES if arrays else SAMPLE)
        if with_estimator:
            only_arrays = settings.get("output.estimates") == "arrays"
            topics.append(ESTIMATES if only_arrays else ESTIMATE)
        nodes.append(
            NodePlan(
                "recorder",
                "hc_logger.recorder_node",
                parameters={
                    "output": str(bag),
                    "expected_topics": topics or [""],
                    "remove_empty": True,
                },
            )
        )
    return RunPlan(tuple(nodes)), bag


def _refuse_without_samples(bag: str) -> None:
    """Say what to do where a bag has no samples for an estimator.

    Raises:
        UserError: always.
    """
    from hc_logger.foreign import open_bag
    from hc_logger.tactile_samples import tactile_topic

    with open_bag(bag) as reader:
        array = tactile_topic(reader)
    if array is not None:
        raise UserError(
            f"{array} of {bag} is of a tactile array, for the node array_estimator: python -m "
            f"hc_estimator.ros.array_node, and hc replay {bag} beside it",
            WRONG_USE,
        )
    raise UserError(
        f"{bag} has no samples (hc_msgs/IndenterSample) for an estimator: hc estimate {bag} "
        "takes its sensors; to see them live, run the estimator that hc setup wrote a file "
        f"for (hc run my_robot_run.yaml), and hc replay {bag} beside it",
        WRONG_USE,
    )


def _sensor_topics(settings: Mapping[str, Any]) -> dict[str, str]:
    """Return the topics that an estimator of sensors listens to, by setting; empty for samples."""
    from hc_estimator.ros.node_settings import NODE_SETTINGS, OWN_SENSORS
    from hc_logger.selection import full_name

    def value(name: str) -> Any:
        return settings.get(name, NODE_SETTINGS[name].default)

    source = value("input.source")
    if source not in OWN_SENSORS:
        return {}
    names = ["input.position.topic"]
    if source == "sensors":
        names.append("input.force.topic")
        moves = value("input.contact.normal_from") == "topic"
        if moves and value("input.contact.frame") == "surface":
            names.append("input.contact.topic")
    return {name: full_name(str(value(name))) for name in names}


def _check_topics(bag: str, source: Path, sensors: Mapping[str, str]) -> None:
    """See that a bag has the topics that an estimator is to listen to.

    Raises:
        UserError: if it has not.
    """
    from hc_logger.foreign import open_bag

    if not sensors:
        return
    with open_bag(source) as opened:
        names = list(opened.topics)
    for setting, topic in sensors.items():
        if topic not in names:
            raise UserError(
                f"{bag} has no topic {topic} ({setting}): it has {', '.join(names)}", WRONG_USE
            )


def _derived(samples: str, usual: str, *, with_samples: bool) -> list[str]:
    """Return what an estimator makes anew: of its own names, and of those beside its samples.

    Args:
        samples: topic of its samples in the bag.
        usual: the same as a node has it; empty where it is that.
        with_samples: whether it makes samples of sensors.
    """
    from hc_msgs_py.topics import SAMPLE, SAMPLES

    namespace = samples.removesuffix(usual) if usual else ""
    made = [f"/{SAMPLE}", f"/{SAMPLES}"] if with_samples else []
    beside = [f"{namespace}{t}" for t in DERIVED_TOPICS if namespace != ""]
    return [*DERIVED_TOPICS, *made, *beside]


def _look_into(source: Path, *, alone: bool) -> tuple[set[str], str, str]:
    """Return the types of a bag's messages, and the topic of its samples with that for a node.

    Args:
        source: the bag.
        alone: whether an estimator is to take its samples, and those of one source only.

    Returns:
        types, and topic and usual topic of the samples; both empty where the topic is the usual
        one, or nobody takes them.

    Raises:
        UserError: if it is no bag, or has the samples of several.
    """
    from hc_logger.errors import BagError
    from hc_logger.foreign import open_bag
    from hc_logger.recording import sample_topic
    from hc_logger.selection import full_name
    from hc_logger.type_names import SAMPLE_TYPE
    from hc_msgs_py.topics import SAMPLE, SAMPLES

    try:
        with open_bag(source) as bag:
            types = {topic.definition.name for topic in bag.topics.values()}
            topic = sample_topic(bag) if alone else None
            if topic is None:
                return types, "", ""
            kind = bag.topics[topic].definition.name
            usual = full_name(SAMPLE if kind == SAMPLE_TYPE else SAMPLES)
            return types, topic, usual if usual != topic else ""
    except BagError as error:
        raise UserError(str(error)) from error
