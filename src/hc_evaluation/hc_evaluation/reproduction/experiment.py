"""An experiment of a paper as checked plain data, read from one YAML file each.

A file spells out every setting: the signal (motion, tissue, noise), and one column per estimator
with the setting it stands for. `paper` columns are the printed filter with the printed numbers,
`practical` ones the same filter guarded and with noise scaled per state, `ours` are this project's
estimators with their defaults untouched.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from pathlib import Path
from typing import Any

import yaml

EXPERIMENT_FOLDER = Path(__file__).resolve().parent / "experiments"
"""The experiments that come with the package; config/experiments of a checkout points here."""

_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same, ten times as fast
SETTINGS = ("paper", "practical", "ours")
FIRST_SEED = 1  # reported seeds count from here; settings were chosen on seeds from 1001 on
DEFAULT = "default"  # as a column's filter: whatever hc_estimator's default is


class ExperimentError(ValueError):
    """An experiment is not known or its file says something that cannot be. One line."""


@dataclass(frozen=True)
class Column:
    """One estimator of an experiment.

    Attributes:
        name: heading in tables and pictures, unique in the experiment.
        setting: "paper", "practical" or "ours".
        filter: a filter of hc_estimator, "default", or "position_ekf" and "position_pf" of paper
            C, which know the tissue and see no force.
        published: the paper's name of this filter, whose printed figures stand beside.
        state_space: as create_estimator takes it.
        start_state: state [d, v, F, K, B, n, p] before the first sample, shape (7,); only `paper`
            state space. Empty: the estimator's own start.
        start_variance: diagonal of P0 for it, shape (7,).
        process_noise: diagonal of Q per sample, shape (7,); only `paper` state space.
        measurement_noise: variances of displacement [mm^2] and force [N^2].
        parameters: further parameters of the estimator.
    """

    name: str
    setting: str
    filter: str
    published: str = ""
    state_space: str = "kinematic"
    start_state: tuple[float, ...] = ()
    start_variance: tuple[float, ...] = ()
    process_noise: tuple[float, ...] = ()
    measurement_noise: tuple[float, ...] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)

    @property
    def adhesive(self) -> bool:
        """Whether its contact law may pull: the papers' law does, ours does not."""
        return self.setting != "ours"


@dataclass(frozen=True)
class Experiment:
    """One table or figure of a paper with what belongs to it.

    Attributes:
        name: the file's stem.
        title: what it is, one line.
        paper: "A", "B" or "C".
        covers: tables and figures of the paper.
        claim: what the paper says, one sentence.
        published: key of the published table, empty if there is none.
        published_rows: printed quantity to the name of our score.
        better: published names of the filter that lost and the one that won.
        ranked_by: the score in which they are compared.
        readings: what the paper leaves open to the reading taken and its reason.
        signal: what signals.make_signal takes.
        scoring: what scores.score takes.
        columns: the estimators.
        pictures: what pictures.draw takes.
        remarks: plain words on why a claim holds or does not, true at any seed.
        not_counted: why our estimators are not held against the printed figures here; empty where
            they are.
        variant_of: the experiment whose noise figures are read the other way here; empty if none.
    """

    name: str
    title: str
    paper: str
    covers: tuple[str, ...]
    claim: str
    published: str
    published_rows: Mapping[str, str]
    better: tuple[str, ...]
    ranked_by: str
    readings: Mapping[str, str]
    signal: Mapping[str, Any]
    scoring: Mapping[str, Any]
    columns: tuple[Column, ...]
    pictures: tuple[Mapping[str, Any], ...]
    remarks: str
    not_counted: str = ""
    variant_of: str = ""

    def column(self, name: str) -> Column:
        """The column of this name.

        Raises:
            KeyError: there is none.
        """
        for column in self.columns:
            if column.name == name:
                return column
        raise KeyError(name)


def available_experiments() -> list[str]:
    """Names of the experiments, in the order of the papers."""
    return sorted(path.stem for path in EXPERIMENT_FOLDER.glob("*.yaml"))


def _checked(name: str, kind: type, data: Mapping[str, Any]) -> Mapping[str, Any]:
    known = {f.name for f in fields(kind)}
    unknown = sorted(set(data) - known)
    if unknown:
        raise ExperimentError(f"{name}: unknown key {unknown[0]!r}; known: {', '.join(known)}")
    return data


def _column(name: str, data: Mapping[str, Any]) -> Column:
    values = dict(_checked(name, Column, data))
    for key in ("start_state", "start_variance", "process_noise", "measurement_noise"):
        values[key] = tuple(float(v) for v in values.get(key, ()))
        lengths = (0, 2) if key == "measurement_noise" else (0, 7)
        if len(values[key]) not in lengths:
            raise ExperimentError(
                f"{name}: {key} of column {values.get('name')!r} has {len(values[key])} numbers, "
                f"must have {lengths[1]}"
            )
    try:
        column = Column(**values)
    except TypeError as error:
        raise ExperimentError(f"{name}: a column is incomplete: {error}") from None
    if column.setting not in SETTINGS:
        raise ExperimentError(
            f"{name}: setting of column {column.name!r} is {column.setting!r}, "
            f"must be one of {', '.join(SETTINGS)}"
        )
    return column


def _read(name: str) -> dict[str, Any]:
    """The data of an experiment's file, completed by those of its base."""
    path = EXPERIMENT_FOLDER / f"{name}.yaml"
    data: dict[str, Any] = yaml.load(path.read_text(encoding="utf-8"), _Loader)
    templates = data.pop("templates", None) or {}  # in a file without base: anchors for columns
    if "base" not in data:
        return data
    variant_of = str(data.pop("base"))
    base = _read(variant_of)
    columns = [
        {**column, **templates[column["setting"]]} if column["setting"] in templates else column
        for column in base["columns"]
        if column["setting"] != "practical"
    ]
    return {
        **base,
        **data,
        "variant_of": variant_of,
        "signal": {**base["signal"], **data.get("signal", {})},
        "covers": [what for what in base["covers"] if not what.startswith("figure")],
        "pictures": [],
        "columns": columns,
    }


@functools.cache
def load_experiment(name: str) -> Experiment:
    """Read an experiment.

    A file may name a `base`: it then is that experiment with another reading of its noise. It has
    its own title, readings and remarks, replaces parts of `signal`, and numbers of all columns of a
    setting by `templates`; it has no practical columns and no pictures.

    Raises:
        ExperimentError: there is no such experiment, or its file is not sound. One line.
    """
    if name not in available_experiments():
        raise ExperimentError(
            f"no experiment {name!r}; known: {', '.join(available_experiments())}"
        )
    data = _read(name)
    values = {"name": name} | data
    values["columns"] = tuple(_column(name, column) for column in data.get("columns", ()))
    for key in ("covers", "better", "pictures"):
        values[key] = tuple(data.get(key, ()))
    defaults = {"published": "", "published_rows": {}, "ranked_by": "", "remarks": ""}
    values = defaults | dict(_checked(name, Experiment, values))
    try:
        experiment = Experiment(**values)
    except TypeError as error:
        raise ExperimentError(f"{name}: {error}") from None
    names = [column.name for column in experiment.columns]
    if len(set(names)) != len(names):
        raise ExperimentError(f"{name}: two columns have the same name")
    return experiment
