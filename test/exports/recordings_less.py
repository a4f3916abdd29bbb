"""Recordings less what lies between tool and tissue: read as `--input` says, or written less it."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np
from hc_msgs.msg import EstimatorConfiguration, IndenterSample
from rclpy.parameter import Parameter
from rclpy.serialization import serialize_message

from hc_bringup import recording_input
from hc_estimator.stream.vocabulary import recorded_less
from hc_logger.writer import BagWriter
from hc_msgs_py.units import set_stamp


def loaded(path: Path, *settings: str) -> Any:
    """Read a recording with settings, NAME=VALUE, as a command does."""
    parser = argparse.ArgumentParser()
    recording_input.add_options(parser)
    words = [word for setting in settings for word in ("--input", setting)]
    return recording_input.load(parser.parse_args([str(path), *words]))


def write_table(path: Path, rows: Any) -> Path:
    """Write stamps, displacements and forces, shape (3, n), as a CSV file; return its path."""
    header = "time_s,displacement_mm,force_N"
    np.savetxt(path, np.column_stack(rows), delimiter=",", header=header, comments="")
    return path


def write_bag(path: Path, setting: str, value: float, rows: Any) -> None:
    """Write samples, shape (3, n), that are recorded less the value of a setting."""
    with BagWriter(path) as writer:
        sample = writer.add_topic("/indenter/sample", "hc_msgs/msg/IndenterSample")
        told = writer.add_topic("/hc/configuration", "hc_msgs/msg/EstimatorConfiguration")
        configuration = EstimatorConfiguration(revision=1, software_version="now")
        already = Parameter(recorded_less(setting), value=value)
        configuration.parameters = [already.to_parameter_msg()]
        writer.write(told, 1, serialize_message(configuration))
        for k, (time_s, depth, force) in enumerate(zip(*rows, strict=True)):
            message = IndenterSample(sequence=k, displacement=depth * 1e-3, force=force)
            set_stamp(message.header.stamp, round(time_s * 1e9))
            writer.write(sample, 1, serialize_message(message))
