"""Soak: rig, estimator and recorder for a long time while the estimator is reconfigured at random.

What is asked of such a run: flat memory, no sample lost, no invalid state. Every estimate is
judged, from the bag that the run recorded.
"""

from __future__ import annotations

import dataclasses
import os
import random
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import rclpy
import yaml
from numpy.typing import NDArray
from rcl_interfaces.srv import SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions

from hc_bringup.commands.run import with_parameters
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_bringup.runner import Runner, RunState
from hc_estimator import available_filters, available_state_spaces
from hc_logger.recording import read_recording
from hc_msgs_py.topics import NODE_ESTIMATOR
from hc_sim_rig.scenario import SCENARIO_FOLDER

RECONFIGURATIONS_PER_S = 20.0
SETTLED_SHARE = 0.2
"""Of the run, at its start, that is left out of the growth of memory: pools fill up there."""

_PARAMETERS = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


@dataclasses.dataclass(frozen=True)
class SoakReport:
    """What a soak found.

    Attributes:
        duration_s: how long samples flowed.
        samples: samples that the rig published.
        lost: samples without an estimate in the bag.
        invalid: estimates with a number that is not finite or a covariance that is none.
        reconfigurations: changes of parameters that the node took.
        refused: changes that it refused, as it should: they were out of range.
        unanswered: changes that it did not answer.
        memory_mb: resident memory of each node at the end [MB].
        memory_growth_mb_per_hour: slope of a line through it, start left out [MB/h].
        cpu_percent: processor use of each node, in percent of a core.
        latency_us: stamp to publication, p50, p99 and maximum [us].
    """

    duration_s: float
    samples: int
    lost: int
    invalid: int
    reconfigurations: int
    refused: int
    unanswered: int
    memory_mb: dict[str, float]
    memory_growth_mb_per_hour: dict[str, float]
    cpu_percent: dict[str, float]
    latency_us: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return it as plain data for --json."""
        return dataclasses.asdict(self)


def run_soak(
    minutes: float,
    *,
    config: str = "run",
    seed: int = 0,
    show: Callable[[RunState], None] = lambda _state: None,
) -> SoakReport:
    """Run a configuration for a while under random reconfiguration and judge what it did.

    Args:
        minutes: how long.
        config: configuration with nodes indenter, estimator and recorder, as for `hc run`.
        seed: of the random reconfigurations.
        show: called about ten times a second with the state of the run.

    Raises:
        UserError: if the configuration cannot be run, or a node died.
    """
    plan = dataclasses.replace(load_plan(find_config(config)), duration_s=60.0 * minutes)
    memory = _Memory()
    with tempfile.TemporaryDirectory(prefix="hc_soak_") as folder:
        bag = Path(folder) / "bag"
        plan = with_parameters(plan, "recorder", {"output": str(bag)})
        plan = with_parameters(plan, "indenter", {"scenario": str(_endless(Path(folder)))})
        with _Disturber(seed) as disturber:

            def look(state: RunState) -> None:
                disturber.active = state.phase == "running"
                if disturber.active:
                    memory.look(state.elapsed_s)
                show(state)

            state = Runner(plan, look).run()
        samples, lost, invalid = _judge(bag, state)
    latency = state.statistics.latency
    return SoakReport(
        duration_s=state.elapsed_s,
        samples=samples,
        lost=lost,
        invalid=invalid,
        reconfigurations=disturber.taken,
        refused=disturber.refused,
        unanswered=disturber.asked - disturber.taken - disturber.refused,
        memory_mb=memory.last(),
        memory_growth_mb_per_hour=memory.growth(),
        cpu_percent=dict(state.cpu_percent),
        latency_us={
            "p50": 1e6 * latency.quantile(0.5),
            "p99": 1e6 * latency.quantile(0.99),
            "max": 1e6 * latency.maximum,
        },
    )


def _endless(folder: Path) -> Path:
    """Write the multi-sine scenario so that it begins again at its end, and return its path."""
    data = yaml.safe_load((SCENARIO_FOLDER / "multisine.yaml").read_text(encoding="utf-8"))
    path = folder / "multisine_without_end.yaml"
    path.write_text(yaml.safe_dump(data | {"at_end": "loop"}), encoding="utf-8")
    return path


def random_settings(generator: random.Random) -> dict[str, Any]:
    """Draw one to three settings of the estimator node, now and then out of range."""
    draws: dict[str, Callable[[], Any]] = {
        "filter": lambda: generator.choice(available_filters()),
        "state_space": lambda: generator.choice(available_state_spaces()),
        "carry_over": lambda: generator.random() < 0.8,
        "outlier_gate": lambda: generator.uniform(2.0, 40.0),  # 3 and more are allowed
        "force_noise_std": lambda: 10.0 ** generator.uniform(-3.0, 0.0),
        "displacement_noise_std": lambda: 10.0 ** generator.uniform(-4.0, -1.0),
        "displacement_exponent_walk": lambda: 10.0 ** generator.uniform(-9.0, -3.0),
        "velocity_exponent_walk": lambda: 10.0 ** generator.uniform(-9.0, -3.0),
        "force_limit": lambda: generator.uniform(500.0, 1500.0),
        "input.silence_timeout": lambda: generator.uniform(0.005, 2.0),  # 0.01 and more
        "contact.minimum_duration": lambda: generator.uniform(-0.02, 0.2),  # 0 and more
    }
    names = generator.sample(sorted(draws), generator.randint(1, 3))
    return {name: draws[name]() for name in names}


class _Disturber:
    """Sets random parameters of the estimator from a thread of its own, while active.

    Attributes:
        active: whether to go on setting.
        asked: changes asked for.
        taken: changes that the node took.
        refused: changes that it refused.
    """

    def __init__(self, seed: int) -> None:
        self.active = False
        self.asked = self.taken = self.refused = 0
        self._generator = random.Random(seed)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="soak_disturber")

    def __enter__(self) -> _Disturber:
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        context = rclpy.Context()
        rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node("hc_soak", context=context, enable_rosout=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        client = node.create_client(
            SetParametersAtomically, f"/{NODE_ESTIMATOR}/set_parameters_atomically"
        )
        due = time.monotonic()
        while not self._stop.is_set():
            due = max(due + 1.0 / RECONFIGURATIONS_PER_S, time.monotonic())
            if self.active and client.service_is_ready():
                self._ask(client)
            while (left := due - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=left)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()

    def _ask(self, client: Any) -> None:
        request = SetParametersAtomically.Request(
            parameters=[
                Parameter(name, value=value).to_parameter_msg()
                for name, value in random_settings(self._generator).items()
            ]
        )
        self.asked += 1
        client.call_async(request).add_done_callback(self._hear)

    def _hear(self, future: Any) -> None:
        if future.result().result.successful:
            self.taken += 1
        else:
            self.refused += 1


class _Memory:
    """Resident memory of the nodes over time: of the child processes that have a node name."""

    def __init__(self) -> None:
        self._next_s = 0.0
        self._times: dict[str, list[float]] = {}
        self._megabytes: dict[str, list[float]] = {}

    def look(self, elapsed_s: float) -> None:
        """Look once a second."""
        if elapsed_s < self._next_s:
            return
        self._next_s = elapsed_s + 1.0
        for name, pid in _children().items():
            self._times.setdefault(name, []).append(elapsed_s)
            self._megabytes.setdefault(name, []).append(_resident_mb(pid))

    def last(self) -> dict[str, float]:
        """Return the newest memory of each node [MB]."""
        return {name: values[-1] for name, values in self._megabytes.items()}

    def growth(self) -> dict[str, float]:
        """Return the slope of a least-squares line for each node [MB/h], start left out."""
        return {
            name: 3600.0 * _slope(np.array(self._times[name]), np.array(values))
            for name, values in self._megabytes.items()
        }


def _slope(time_s: NDArray[np.float64], values: NDArray[np.float64]) -> float:
    settled = time_s >= SETTLED_SHARE * time_s[-1]
    if np.count_nonzero(settled) < 3:
        return float("nan")
    return float(np.polyfit(time_s[settled], values[settled], 1)[0])


def _children() -> dict[str, int]:
    """Return process ids of this process's children by the node name in their command line."""
    result = {}
    tasks = Path("/proc/self/task")
    for task in tasks.iterdir():
        try:
            children = (task / "children").read_text().split()
        except OSError:
            continue  # the thread has ended meanwhile
        for child in children:
            try:
                command = Path(f"/proc/{child}/cmdline").read_bytes().decode().split("\0")
            except OSError:
                continue  # the process has
            names = [a.removeprefix("__node:=") for a in command if a.startswith("__node:=")]
            if names:
                result[names[0]] = int(child)
    return result


def _resident_mb(pid: int) -> float:
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except OSError:
        return float("nan")
    return pages * os.sysconf("SC_PAGESIZE") / 1e6


def _judge(bag: Path, state: RunState) -> tuple[int, int, int]:
    """Return samples published, samples without estimate, and invalid estimates of a bag."""
    table = read_recording(bag).estimates
    # What the rig said last may be older than its last samples: they count from 0.
    samples = max(state.samples or 0, int(table["sequence"].max()) + 1 if len(table) else 0)
    lost = samples - len(np.unique(table["sequence"]))
    parameters = np.stack([table[name] for name in _PARAMETERS], axis=1)
    covariance = table["covariance"].reshape(-1, 4, 4)
    finite = np.isfinite(parameters).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    deviations = np.sqrt(np.maximum(np.einsum("kii->ki", covariance), 0.0))
    scale = deviations[:, :, None] * deviations[:, None, :]
    # A covariance: variances not negative, correlations within -1 and 1 (to rounding).
    sound = np.einsum("kii->ki", covariance) >= 0.0
    bounded = np.abs(covariance) <= scale * (1.0 + 1e-6) + 1e-300
    valid = finite & sound.all(axis=1) & bounded.all(axis=(1, 2))
    return samples, lost, int(np.count_nonzero(~valid))
