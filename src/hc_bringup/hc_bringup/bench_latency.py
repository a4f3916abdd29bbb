"""Latency of the estimates as distributions: by rate, number of subscribers, idle and loaded.

Each case is a run of its own: rig, estimator and recorder, and subscribers of hc/estimate in
processes beside them (latency_listener.py). The latency is that from a sample's stamp to the
publication of its estimate, as the estimator tells it with every estimate. What of its tail is the
machine's is measured in the same run (machine_wake_ups.py). The load is a C++
compiler that compiles the same file again and again on the last processor; where there is none,
Python that compiles itself.
"""

from __future__ import annotations

import dataclasses
import itertools
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import yaml
from numpy.typing import NDArray

from hc_bringup.array_messages import with_array_messages
from hc_bringup.commands.run import with_parameters
from hc_bringup.errors import UserError
from hc_bringup.machine_wake_ups import FASTEST_HZ
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_bringup.run_state import RunState
from hc_bringup.runner import Runner
from hc_sim_rig.scenario import SCENARIO_FOLDER

if TYPE_CHECKING:
    from matplotlib.figure import Figure

RATES_HZ: Final = (1000.0, 2000.0, 4000.0, 7000.0)
SUBSCRIBERS: Final = (1, 4)
SETTLING_S: Final = 5.0
"""Left out at the beginning of each case: the default filter begins, caches fill."""
QUANTILES: Final = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
_LOAD: Final = (
    "import compileall, glob, itertools, os, subprocess, sys\n"
    "os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})\n"
    "words = sys.argv[1:]\n"
    "text = open(os.__file__).read()\n"
    "for _ in itertools.count():\n"
    "    subprocess.run(words, check=True) if words else compile(text, 'os', 'exec')\n"
)
_COMPILED: Final = (
    "#include <algorithm>\n#include <map>\n#include <regex>\n#include <string>\n#include <vector>\n"
    "int f(const std::string &t) { std::map<std::string, std::vector<int>> m; m[t].push_back(1);\n"
    'std::sort(m[t].begin(), m[t].end()); return std::regex_match(t, std::regex("a+b*")); }\n'
)

Case = dict[str, Any]


class _Run:
    """Subscribers, load and bare wake-ups of one case; the latter two begin with the samples."""

    def __init__(
        self,
        folder: Path,
        subscribers: int,
        loaded: bool,
        form: str,
        rate_hz: float,
        seconds: float,
    ) -> None:
        self._wake_ups: subprocess.Popen[bytes] | None = None
        self._wake_ups_file = folder / "wake_ups.npy"
        self._wake_ups_command = [
            *(sys.executable, "-m", "hc_bringup.machine_wake_ups"),
            *(str(self._wake_ups_file), str(rate_hz), str(seconds)),
        ]
        self._files = [folder / f"listener_{i}.npz" for i in range(subscribers)]
        self._load: subprocess.Popen[bytes] | None = None
        self._folder, self._loaded = folder, loaded
        self._listeners = [
            subprocess.Popen(
                [sys.executable, "-m", "hc_bringup.latency_listener", str(file), form],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            for file in self._files
        ]
        for listener in self._listeners:
            assert listener.stdout is not None
            if listener.stdout.readline().strip() != b"ready":
                self.close()
                raise UserError("a subscriber does not start")

    def look(self, state: RunState) -> None:
        """Begin with the samples."""
        if self._wake_ups is None and state.phase == "running":
            self._wake_ups = subprocess.Popen(self._wake_ups_command, stdin=subprocess.PIPE)
        if self._loaded and self._load is None and state.phase == "running":
            self._load = subprocess.Popen(
                [sys.executable, "-c", _LOAD, *_compiler(self._folder)], start_new_session=True
            )

    def close(self) -> list[dict[str, NDArray[Any]]]:
        """End all of them; return what each of the subscribers saw."""
        if self._wake_ups is not None:
            self._wake_ups.communicate(timeout=60.0)
        if self._load is not None:
            os.killpg(self._load.pid, 9)  # the load's own group: it and its compiler
            self._load.wait()
        for listener in self._listeners:
            listener.communicate(timeout=60.0)
        return [dict(np.load(file)) for file in self._files if file.exists()]

    def wake_ups_s(self) -> NDArray[np.float64]:
        """Return how late the machine's own wake-ups were, in their order [s]."""
        file = self._wake_ups_file
        return np.load(file) if file.exists() else np.empty(0)


def _compiler(folder: Path) -> list[str]:
    """Return the words that compile something, nothing without a compiler."""
    compiler = shutil.which(os.environ.get("CXX") or "c++")
    if compiler is None:
        return []
    source = folder / "load.cpp"
    source.write_text(_COMPILED)
    return [compiler, "-O2", "-c", str(source), "-o", str(folder / "load.o")]


def bench_latency(
    seconds: float,
    rates_hz: Sequence[float] = RATES_HZ,
    subscribers: Sequence[int] = SUBSCRIBERS,
    loads: Sequence[bool] = (False, True),
    *,
    filter_name: str | None = None,
    together_hz: float | None = None,
    show: Callable[[RunState], None] = lambda _state: None,
) -> list[Case]:
    """Measure every combination.

    Args:
        seconds: how long each is measured, after some seconds that do not count.
        rates_hz: of the samples.
        subscribers: of hc/estimate beside the recorder.
        loads: whether a compiler runs beside.
        filter_name: of the estimator; None takes that of its configuration.
        together_hz: messages a second at most: samples of higher rates travel together in
            hc_msgs/IndenterSamples, and their estimates in hc_msgs/HuntCrossleyEstimates. None:
            each in a message of its own.
        show: called about ten times a second with the state of the run.

    Returns:
        Of each case rate_hz, subscribers, loaded, samples_per_message, samples (that were
        estimated), lost, skipped, latency_us and arrival_us (p50, p99, p99.9, max; the first from
        stamp to publication, the other to the subscriber), machine_us (the same of the machine's
        own wake-ups meanwhile), cpu_percent by node, and latencies_s.

    Raises:
        UserError: if the suite cannot be run.
    """
    cases = []
    for rate, number, loaded in itertools.product(rates_hz, subscribers, loads):
        together = 1 if together_hz is None else max(1, round(rate / together_hz))
        cases.append(_measure(seconds, rate, number, loaded, together, filter_name, show))
    return cases


def _measure(
    seconds: float,
    rate_hz: float,
    subscribers: int,
    loaded: bool,
    together: int,
    filter_name: str | None,
    show: Callable[[RunState], None],
) -> Case:
    with tempfile.TemporaryDirectory(prefix="hc_latency_") as name:
        folder = Path(name)
        scenario = yaml.safe_load((SCENARIO_FOLDER / "multisine.yaml").read_text())
        scenario |= {"rate_hz": rate_hz, "duration_s": 60.0 + 2.0 * (SETTLING_S + seconds)}
        (folder / "scenario.yaml").write_text(yaml.safe_dump(scenario))
        plan = dataclasses.replace(load_plan(find_config("run")), duration_s=SETTLING_S + seconds)
        rig = {"scenario": str(folder / "scenario.yaml"), "samples_per_message": together}
        estimator: dict[str, Any] = {"expected_estimate_subscribers": 1 + subscribers}
        if filter_name is not None:
            estimator["filter"] = filter_name
        for node, parameters in (
            ("indenter", rig),
            ("estimator", estimator),
            ("recorder", {"output": str(folder / "bag")}),
        ):
            plan = with_parameters(plan, node, parameters)
        plan = with_array_messages(plan)
        form = "arrays" if together > 1 else "each"
        messages_hz = rate_hz / together
        beside = _Run(folder, subscribers, loaded, form, messages_hz, SETTLING_S + seconds)

        def look(state: RunState) -> None:
            beside.look(state)
            show(state)

        seen: list[dict[str, NDArray[Any]]] = []
        try:
            state = Runner(plan, look, with_estimates=False).run()
        finally:
            seen = beside.close()
        machine_s = beside.wake_ups_s()[round(SETTLING_S * min(messages_hz, FASTEST_HZ)) :]
    skipped = int(float(state.diagnostics.get("estimator", {}).get("skipped", "nan")))
    first = max((one for one in seen), key=lambda one: len(one["sequence"]))
    counted = first["sequence"] >= SETTLING_S * rate_hz
    sequence = first["sequence"][counted]
    lost = int(sequence[-1] - sequence[0]) + 1 - len(np.unique(sequence)) if len(sequence) else 0
    latencies = first["latency"][counted]
    arrivals = np.concatenate(
        [one["arrival"][one["sequence"] >= SETTLING_S * rate_hz] for one in seen]
    )
    return {
        "rate_hz": rate_hz,
        "subscribers": subscribers,
        "loaded": loaded,
        "samples_per_message": together,
        "samples": len(sequence),
        "lost": lost,
        "skipped": skipped,
        "latency_us": _quantiles(latencies),
        "arrival_us": _quantiles(arrivals),
        "machine_us": _quantiles(machine_s),
        "cpu_percent": dict(state.cpu_percent),
        "latencies_s": latencies,
    }


def _quantiles(values_s: NDArray[np.float64]) -> dict[str, float]:
    """Return quantiles and the largest [us]; NaN for nothing."""
    if not len(values_s):
        return dict.fromkeys([*QUANTILES, "max"], float("nan"))
    figures = {name: 1e6 * float(np.quantile(values_s, q)) for name, q in QUANTILES.items()}
    return figures | {"max": 1e6 * float(values_s.max())}


def text_table(cases: Sequence[Case]) -> str:
    """Return the cases as a Markdown table."""
    lines = [
        "| rate | subscribers | machine | samples | lost | p50 us | p99 us | p99.9 us | largest us "
        "| rig, estimator, recorder, % of a core "
        "| the machine's own wake-ups: p50, p99, p99.9, largest us |",
        "|---" * 11 + "|",
    ]
    for case in cases:
        figures = " | ".join(f"{case['latency_us'][n]:.0f}" for n in (*QUANTILES, "max"))
        own = ", ".join(f"{case['machine_us'][n]:.0f}" for n in (*QUANTILES, "max"))
        load = ", ".join(f"{v:.0f}" for v in case["cpu_percent"].values())
        machine = "a compiler runs" if case["loaded"] else "as it is"
        message = case["samples_per_message"]
        rate = f"{case['rate_hz'] / 1000:g} kHz" + (f", {message} together" if message > 1 else "")
        lines.append(
            f"| {rate} | {case['subscribers']} | {machine} | {case['samples']} | {case['lost']} "
            f"| {figures} | {load} | {own} |"
        )
    return "\n".join(lines)


def draw(cases: Sequence[Case], file: Path) -> None:
    """Draw which share of the estimates is later than a time, a curve for each case.

    Raises:
        OSError: if the file cannot be written.
    """
    from matplotlib import rc_context

    from hc_sim_rig.picture_style import STYLE, save

    with rc_context(STYLE):
        save(_curves(cases), file)


def _curves(cases: Sequence[Case]) -> Figure:
    from hc_sim_rig.picture_style import SEVERAL, legend_below, new_figure

    loads = sorted({case["loaded"] for case in cases})
    figure = new_figure(4.4)
    grid = figure.subplots(1, len(loads), sharex=True, sharey=True, squeeze=False)[0]
    rates = sorted({case["rate_hz"] for case in cases})
    most = max(case["subscribers"] for case in cases)
    for axes, loaded in zip(grid, loads, strict=True):
        for case in cases:
            ordered = np.sort(case["latencies_s"])[::-1] * 1e3
            if case["loaded"] != loaded or not len(ordered):
                continue
            share = np.arange(1, len(ordered) + 1) / len(ordered)
            few = case["subscribers"] < most or len({c["subscribers"] for c in cases}) == 1
            axes.plot(
                np.maximum(ordered, 1e-2),
                share,
                color=SEVERAL[rates.index(case["rate_hz"]) % len(SEVERAL)],
                linestyle="-" if few else "--",
                label=f"{case['rate_hz'] / 1000:g} kHz, {case['subscribers']} subscribers".replace(
                    "1 subscribers", "1 subscriber"
                ),
            )
        axes.set_title("a compiler runs beside" if loaded else "nothing beside")
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("latency, stamp to publication [ms]")
    grid[0].set_ylabel("share of the estimates that are later")
    # Below the curves: they fill their frames from corner to corner.
    legend_below(figure, *grid[0].get_legend_handles_labels(), ncols=4)
    return figure
