"""Soak: a run for a long time, reconfigured at random, with viewers that come and go.

What is asked of it: flat memory, descriptors and threads, no sample lost, no invalid state. Every
estimate is judged, from the bag that the run recorded.
"""

from __future__ import annotations

import dataclasses
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from numpy.typing import NDArray

from hc_bringup.commands.run import with_parameters
from hc_bringup.paths import find_config
from hc_bringup.plan import load_plan
from hc_bringup.run_state import RunState
from hc_bringup.runner import Runner
from hc_bringup.soak_disturbers import ParameterStorm, Viewers
from hc_bringup.soak_resources import Resources
from hc_logger.recording import read_recording
from hc_sim_rig.scenario import SCENARIO_FOLDER

PARAMETERS = ("stiffness", "damping", "displacement_exponent", "velocity_exponent")


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
        viewers: command lines that looked at the run meanwhile, and ended roughly.
        memory_mb: resident memory of each node at the end [MB].
        memory_growth_mb_per_hour: slope of a line through it, start left out [MB/h].
        descriptor_growth: file descriptors more at the end than after the start, by node.
        thread_growth: the same for threads.
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
    viewers: int
    memory_mb: dict[str, float]
    memory_growth_mb_per_hour: dict[str, float]
    descriptor_growth: dict[str, float]
    thread_growth: dict[str, float]
    cpu_percent: dict[str, float]
    latency_us: dict[str, float]

    @property
    def passed(self) -> bool:
        """Whether nothing was lost and nothing invalid."""
        return not self.lost and not self.invalid

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
    resources = Resources()
    with tempfile.TemporaryDirectory(prefix="hc_soak_") as folder:
        bag = Path(folder) / "bag"
        plan = with_parameters(plan, "recorder", {"output": str(bag)})
        plan = with_parameters(plan, "indenter", {"scenario": str(endless(Path(folder)))})
        with ParameterStorm(seed) as storm, Viewers(seed) as viewers:

            def look(state: RunState) -> None:
                storm.active = state.phase == "running"
                if storm.active:
                    resources.look(state.pids, state.elapsed_s)
                    viewers.look(state.elapsed_s)
                show(state)

            state = Runner(plan, look).run()
        samples, lost, invalid = _judge(bag, state)
    latency = state.statistics.latency
    return SoakReport(
        duration_s=state.elapsed_s,
        samples=samples,
        lost=lost,
        invalid=invalid,
        reconfigurations=storm.taken,
        refused=storm.refused,
        unanswered=storm.asked - storm.taken - storm.refused,
        viewers=viewers.count,
        memory_mb=resources.memory_mb(),
        memory_growth_mb_per_hour=resources.memory_growth(),
        descriptor_growth=resources.descriptor_growth(),
        thread_growth=resources.thread_growth(),
        cpu_percent=dict(state.cpu_percent),
        latency_us={
            "p50": 1e6 * latency.quantile_s(0.5),
            "p99": 1e6 * latency.quantile_s(0.99),
            "max": 1e6 * latency.maximum_s,
        },
    )


def endless(folder: Path) -> Path:
    """Write the multi-sine scenario so that it begins again at its end, and return its path."""
    data = yaml.safe_load((SCENARIO_FOLDER / "multisine.yaml").read_text(encoding="utf-8"))
    path = folder / "multisine_without_end.yaml"
    path.write_text(yaml.safe_dump(data | {"at_end": "loop"}), encoding="utf-8")
    return path


def _judge(bag: Path, state: RunState) -> tuple[int, int, int]:
    """Return samples published, samples without estimate, and invalid estimates of a bag."""
    table = read_recording(bag).estimates
    # What the rig said last may be older than its last samples: they count from 0.
    samples = max(state.samples or 0, int(table["sequence"].max()) + 1 if len(table) else 0)
    return samples, samples - len(np.unique(table["sequence"])), count_invalid(table)


def count_invalid(table: NDArray[Any]) -> int:
    """Return how many recorded estimates have a number or a covariance that is none."""
    parameters = np.stack([table[name] for name in PARAMETERS], axis=1)
    covariance = table["covariance"].reshape(-1, 4, 4)
    finite = np.isfinite(parameters).all(axis=1) & np.isfinite(covariance).all(axis=(1, 2))
    deviations = np.sqrt(np.maximum(np.einsum("kii->ki", covariance), 0.0))
    scale = deviations[:, :, None] * deviations[:, None, :]
    # A covariance: variances not negative, correlations within -1 and 1 (to rounding).
    sound = np.einsum("kii->ki", covariance) >= 0.0
    bounded = np.abs(covariance) <= scale * (1.0 + 1e-6) + 1e-300
    valid = finite & sound.all(axis=1) & bounded.all(axis=(1, 2))
    return int(np.count_nonzero(~valid))
