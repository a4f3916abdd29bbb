"""hc simulate: the rig as fast as it can, into a CSV file or a bag."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from hc_bringup.errors import WRONG_USE, UserError
from hc_bringup.options import OTHER_ENDINGS, natural, new_file_name, positive
from hc_bringup.wrapping import wrapped

HELP = "run a scenario of the rig as fast as possible into a CSV file or a bag"
COMPILES = True
BAG_EPOCH_NS = 1_000_000_000 * 1_000_000_000
"""Stamp of the first sample in a bag: fixed, so that the same seed gives the same bytes."""
BLOCK = 1024
"""Samples written at a time."""
TRUTH_TYPE = "hc_msgs/msg/IndenterTruth"


def configure(parser: argparse.ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="name or YAML file (none: list them)"
    )
    parser.add_argument(
        "-o",
        "--output",
        type=new_file_name,
        metavar="OUT",
        help="CSV file (.csv) or bag folder",
    )
    parser.add_argument("--seed", type=natural, metavar="N", help="seed (default: the scenario's)")
    parser.add_argument("--duration", type=positive, metavar="S", help="length in seconds")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    from hc_sim_rig.rig import Rig
    from hc_sim_rig.scenario import available_scenarios, load_scenario
    from hc_sim_rig.schema import ScenarioError

    if arguments.scenario is None:
        if arguments.output is not None:
            raise UserError("name a scenario before -o; hc simulate lists them", WRONG_USE)
        for name in available_scenarios():
            print(f"{name:<22}{load_scenario(name).description}")
        return 0
    if arguments.output is None:
        raise UserError("give the CSV file or bag folder to write with -o", WRONG_USE)
    target = Path(arguments.output)
    if target.exists():
        raise UserError(f"{target} exists already: choose another name", WRONG_USE)
    if target.name.lower().endswith(OTHER_ENDINGS):
        raise UserError(
            f"{target}: give a name that ends in .csv, or that of the folder of a bag", WRONG_USE
        )
    try:
        scenario = load_scenario(arguments.scenario)
        rig = Rig(scenario, arguments.seed)
        series = rig.run(arguments.duration)
    except (ScenarioError, OSError) as error:
        raise UserError(str(error), WRONG_USE) from error
    if not len(series):
        raise UserError(
            f"--duration {arguments.duration:g}: no sample is taken in it, at {rig.rate_hz:g} Hz",
            WRONG_USE,
        )
    if target.suffix.lower() == ".csv":
        _write_csv(target, series)
    else:
        _write_bag(target, series, arguments.scenario)
    if arguments.duration is None and (line := scenario.never_happens()):
        print(wrapped(line, stream=sys.stderr), file=sys.stderr)
    print(f"{len(series)} samples at {rig.rate_hz:g} Hz written to {target}")
    if scenario.taxels is not None:
        line = (
            f"{target} holds the tip alone: what the taxels read is published, and recorded, by "
            f"hc run --scenario {arguments.scenario}"
        )
        print(wrapped(line, stream=sys.stderr), file=sys.stderr)
    return 0


def _write_csv(target: Path, series: Any) -> None:
    import numpy as np

    from hc_logger.csv_file import write_csv
    from hc_logger.errors import BagError

    try:
        write_csv(
            target, [np.column_stack([series.time_s, series.displacement_mm, series.force_n])]
        )
    except BagError as error:
        raise UserError(str(error)) from error


def _write_bag(target: Path, series: Any, scenario: str) -> None:
    """Write indenter/sample and indenter/truth, block by block so that they lie interleaved."""
    import numpy as np

    from hc_logger.convert import SAMPLE_PROFILE, SampleWriter
    from hc_logger.definitions import installed_definition
    from hc_logger.errors import BagError
    from hc_logger.layout import encode
    from hc_logger.writer import BagWriter, os_errors
    from hc_msgs_py.topics import FRAME_INDENTER_TIP, TRUTH
    from hc_msgs_py.units import METRE_IN_MM, NANOSECONDS

    stamps = BAG_EPOCH_NS + np.rint(series.time_s * NANOSECONDS).astype(np.int64)
    sequence = series.sequence.astype(np.uint64)
    truth = series.truth
    definition = installed_definition(TRUTH_TYPE)
    try:
        with (
            os_errors(f"cannot write {target}"),
            BagWriter(target, custom_data={"hc_scenario": scenario}) as writer,
        ):
            samples = SampleWriter(writer)
            topic = writer.add_topic(TRUTH, TRUTH_TYPE, qos_profiles=[SAMPLE_PROFILE])
            for first in range(0, len(series), BLOCK):
                part = slice(first, first + BLOCK)
                samples.write(
                    stamps[part],
                    sequence[part],
                    series.displacement_mm[part],
                    series.force_n[part],
                )
                data = encode(
                    definition,
                    FRAME_INDENTER_TIP,
                    header__stamp__sec=stamps[part] // NANOSECONDS,
                    header__stamp__nanosec=stamps[part] % NANOSECONDS,
                    sequence=sequence[part],
                    displacement=truth.displacement_mm[part] / METRE_IN_MM,
                    velocity=truth.velocity_mm_s[part] / METRE_IN_MM,
                    force=truth.force_n[part],
                    stiffness=truth.parameters[part, 0],
                    damping=truth.parameters[part, 1],
                    displacement_exponent=truth.parameters[part, 2],
                    velocity_exponent=truth.parameters[part, 3],
                    contact=truth.contact[part],
                )
                for stamp, row in zip(stamps[part].tolist(), data, strict=True):
                    writer.write(topic, stamp, row.tobytes(), stamp)
    except BagError as error:
        raise UserError(str(error)) from error
