"""What a shell may complete besides commands and options: filters, scenarios, presets."""

from __future__ import annotations

import argparse
import glob
import os
import re
from collections.abc import Callable, Iterator
from typing import Final

from hc_bringup.paths import config_folder

_IS_RUN: Final = re.compile(r"^nodes:", re.MULTILINE)


def attach(parser: argparse.ArgumentParser) -> None:
    """Tell argcomplete which values the options of a parser and of its commands take."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                attach(command)
        elif (values := _VALUES.get(action.dest)) is not None and action.choices is None:
            action.completer = values  # type: ignore[attr-defined]  # as argcomplete wants it


def _filters(**_: object) -> list[str]:
    from hc_estimator import available_filters

    return list(available_filters())


def _scenarios(prefix: str, **_: object) -> list[str]:
    from hc_sim_rig.scenario import available_scenarios

    return [*available_scenarios(), *_files(prefix)]


def _runs(prefix: str, **_: object) -> list[str]:
    return [*_of_config(is_run=True), *_files(prefix)]


def _presets(prefix: str, **_: object) -> list[str]:
    return [*_of_config(is_run=False), *_files(prefix)]


def _of_config(*, is_run: bool) -> Iterator[str]:
    """Names of the configurations that start a run, or of the presets of files."""
    folder = config_folder()
    for path in sorted(folder.rglob("*.yaml")):
        starts = _IS_RUN.search(path.read_text(encoding="utf-8")) is not None
        name = path.relative_to(folder).with_suffix("").as_posix()
        if starts == is_run and (is_run or name.startswith("robots/")):
            yield name


def _files(prefix: str) -> list[str]:
    found = glob.glob(f"{glob.escape(prefix)}*")
    return [f"{name}{os.sep}" if os.path.isdir(name) else name for name in found]


_VALUES: Final[dict[str, Callable[..., list[str]]]] = {
    "filter": _filters,
    "scenario": _scenarios,
    "config": _runs,
    "preset": _presets,
}
