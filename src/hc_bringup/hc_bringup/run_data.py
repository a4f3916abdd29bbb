"""What a report shows of a recording: its own estimates if it has some, else fresh ones."""

from __future__ import annotations

from typing import Any

import numpy as np

from hc_bringup.errors import UserError
from hc_bringup.picture import RunData
from hc_estimator import PARAMETER_NAMES
from hc_logger.errors import BagError
from hc_logger.foreign import open_bag
from hc_logger.layout import INTEGER, REAL, records
from hc_logger.recorded import only_topic
from hc_logger.recording import Recording
from hc_msgs_py.topics import TRUTH

_TRUTH_TYPE = "hc_msgs/msg/IndenterTruth"


def recorded(recording: Recording) -> RunData | None:
    """Return the run as it was recorded, or None if the recording holds no estimates.

    Raises:
        UserError: if the bag cannot be read.
    """
    if not recording.is_bag:
        return None
    try:
        table = recording.estimates
    except BagError as error:
        raise UserError(str(error)) from error
    if not len(table):
        return None
    order = {int(s): i for i, s in enumerate(recording.sequence)}
    rows = np.array([order.get(int(s), -1) for s in table["sequence"]])
    table, rows = table[rows >= 0], rows[rows >= 0]
    if not len(table):
        return None
    configurations = recording.configurations
    name = f", {configurations[-1].filter}" if configurations else ""
    return RunData(
        title=f"{recording.path.name}{name}",
        time_s=recording.time_s[rows],
        displacement_mm=recording.displacement_mm[rows],
        force_n=recording.force_n[rows],
        force_predicted_n=table["force_predicted"],
        parameters=np.column_stack([table[n] for n in PARAMETER_NAMES]),
        parameters_std=np.column_stack([table[f"{n}_std"] for n in PARAMETER_NAMES]),
        nis=table["nis"],
        change_detected=table["change_detected"].astype(bool),
        model_mismatch=table["model_mismatch"].astype(bool),
        truth=_truth(recording, table["sequence"]),
    )


def estimated(recording: Recording, estimator: Any) -> RunData:
    """Return the run with the estimates of an estimator over the recording."""
    series = estimator.run(recording.time_s, recording.displacement_mm, recording.force_n)
    with np.errstate(invalid="ignore", over="ignore"):  # times need not be finite
        time_s = recording.time_s - recording.time_s[0]
    return RunData(
        title=f"{recording.path.name}, {estimator.filter} on {estimator.state_space}",
        time_s=time_s,
        displacement_mm=recording.displacement_mm,
        force_n=recording.force_n,
        force_predicted_n=series.force_predicted,
        parameters=series.parameters,
        parameters_std=series.parameters_std,
        nis=series.nis,
        change_detected=series.change_detected,
        model_mismatch=series.model_mismatch,
        truth=_truth(recording, recording.sequence) if recording.is_bag else None,
    )


def _truth(recording: Recording, sequence: Any) -> Any:
    """Return the true parameters (samples, 4) at these sequence numbers, or None."""
    with open_bag(recording.path) as bag:
        topic = only_topic(bag, _TRUTH_TYPE, TRUTH)
        if topic is None:
            return None
        fields = {"sequence": INTEGER, **dict.fromkeys(PARAMETER_NAMES, REAL)}
        table = records(bag.topics[topic].definition, bag.columns(topic), fields)
    at = np.searchsorted(table["sequence"], sequence)
    found = at < len(table)
    found[found] = table["sequence"][at[found]] == sequence[found]
    if not found.any():
        return None
    truth = np.full((len(sequence), 4), np.nan)
    for index, name in enumerate(PARAMETER_NAMES):
        truth[found, index] = table[name][at[found]]
    return truth if np.isfinite(truth).any(axis=0).all() else None
