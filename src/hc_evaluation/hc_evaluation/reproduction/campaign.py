"""Runs experiments over seeds on several processes, keeps what is finished, and resumes.

Every finished seed of an experiment is one line of OUTPUT/runs/NAME.jsonl. The first line holds a
fingerprint of the experiment and of the code that makes its numbers: if it differs, the file starts
anew. Results do not depend on the number of workers: a run is a function of experiment and seed.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import hc_estimator
import hc_evaluation
import hc_sim_rig
from hc_evaluation.reproduction.experiment import (
    FIRST_SEED,
    available_experiments,
    load_experiment,
)
from hc_evaluation.reproduction.pictures import draw
from hc_evaluation.reproduction.scores import Scores, floors, identifiable, score
from hc_evaluation.reproduction.signals import make_signal
from hc_evaluation.reproduction.trace import run_column
from hc_evaluation.workers import WorkerDiedError, each

QUICK_SEEDS = 3
CHUNK = 2  # seeds of an experiment in one task

Runs = dict[str, dict[int, dict[str, Scores]]]  # experiment, seed, column
Progress = Callable[[str, int, int], None]
"""Called with the experiment's name, the runs finished and the runs in all (seeds)."""


class ReproductionError(RuntimeError):
    """The campaign cannot run as asked. One line."""


@dataclass
class ExperimentResult:
    """The scores of an experiment: by column and score, one number per seed in their order."""

    name: str
    seeds: list[int]
    columns: dict[str, dict[str, list[float]]]
    identifiable: tuple[str, ...]
    floors: dict[str, float]


@dataclass
class ReproductionResult:
    """What a campaign found.

    Attributes:
        experiments: results by experiment, in the order of the papers.
        output: folder with tables, pictures and results.
        files: what was written there.
    """

    experiments: dict[str, ExperimentResult]
    output: Path
    files: list[Path] = field(default_factory=list)


def _source_files(package: Path) -> Iterator[Path]:
    return iter(sorted(package.rglob("*.py")))


def fingerprint(name: str) -> str:
    """Hash of all that an experiment's numbers depend on: its settings and the code behind them.

    Texts (claim, readings, remarks) may change without a new run.
    """
    experiment = load_experiment(name)
    settings = [experiment.signal, experiment.scoring, [asdict(c) for c in experiment.columns]]
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    evaluation = Path(hc_evaluation.__file__).parent
    here = evaluation / "reproduction"
    own = [here / f"{stem}.py" for stem in ("experiment", "signals", "trace", "scores")]
    own += [here / "position_filters.py", evaluation / "bounds.py"]
    own += [evaluation / "hold_forward.py"]
    for path in own:
        digest.update(path.read_bytes())
    for package, leave in ((hc_estimator, ("ros", "stream")), (hc_sim_rig, ())):
        root = Path(str(package.__file__)).parent
        for path in _source_files(root):
            relative = path.relative_to(root)
            if relative.parts[0] not in leave and not path.name.endswith("node.py"):
                digest.update(path.read_bytes())
    for path in sorted((Path(str(hc_sim_rig.__file__)).parent / "scenarios").glob("*.yaml")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def run_seeds(name: str, seeds: Sequence[int]) -> dict[int, dict[str, Scores]]:
    """Run all columns of an experiment on some seeds.

    Args:
        name: the experiment.
        seeds: seeds of the data.

    Returns:
        Scores by seed and column.
    """
    experiment = load_experiment(name)
    scoring = dict(experiment.scoring) | {"identifiable": identifiable(name)}
    result: dict[int, dict[str, Scores]] = {}
    for seed in seeds:
        data = make_signal(experiment.signal, seed)
        result[seed] = {
            column.name: score(data, run_column(column, data, experiment.signal), scoring)
            for column in experiment.columns
        }
    return result


def _stored(path: Path, mark: str) -> dict[int, dict[str, Scores]]:
    """Finished seeds of a file with the same fingerprint; a line cut off by a crash ends it."""
    if not path.is_file():
        return {}
    lines = path.read_text(encoding="utf-8").splitlines()
    found: dict[int, dict[str, Scores]] = {}
    for number, line in enumerate(lines):
        try:
            entry = json.loads(line)
        except json.JSONDecodeError:
            break
        if number == 0:
            if entry.get("fingerprint") != mark:
                return {}
        else:
            found[int(entry["seed"])] = entry["scores"]
    return found


def _write(path: Path, mark: str, runs: Mapping[int, Mapping[str, Scores]]) -> None:
    lines = [json.dumps({"fingerprint": mark})]
    lines += [json.dumps({"seed": seed, "scores": runs[seed]}) for seed in sorted(runs)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _append(path: Path, runs: Mapping[int, Mapping[str, Scores]]) -> None:
    with path.open("a", encoding="utf-8") as file:
        for seed, scores in runs.items():
            file.write(json.dumps({"seed": seed, "scores": scores}) + "\n")


def _tasks(missing: Mapping[str, Sequence[int]]) -> list[tuple[str, list[int]]]:
    """Chunks of all experiments in turn, so that an interrupted campaign has some of each."""
    chunks = {
        name: [list(seeds[i : i + CHUNK]) for i in range(0, len(seeds), CHUNK)]
        for name, seeds in missing.items()
    }
    longest = max((len(c) for c in chunks.values()), default=0)
    return [(name, c[i]) for i in range(longest) for name, c in chunks.items() if i < len(c)]


def _do(piece: tuple[str, list[int] | None, Path]) -> Any:
    """Run some seeds of an experiment, or draw its pictures if none are named."""
    name, seeds, folder = piece
    return draw(name, folder) if seeds is None else run_seeds(name, seeds)


def _compute(
    tasks: Sequence[tuple[str, list[int]]],
    drawings: Sequence[str],
    folder: Path,
    workers: int,
    finished: Callable[[str, dict[int, dict[str, Scores]]], None],
) -> list[Path]:
    """Run the tasks and draw the pictures, in this process or in several.

    Raises:
        ReproductionError: a task ended every process that tried it.
    """
    pieces = [*((*task, folder) for task in tasks), *((name, None, folder) for name in drawings)]
    drawn: dict[int, list[Path]] = {}
    try:
        for place, result in each(_do, pieces, workers):
            name, seeds, _ = pieces[place]
            if seeds is None:
                drawn[place] = result
            else:
                finished(name, result)
    except WorkerDiedError as error:
        raise ReproductionError(str(error)) from None
    return [path for place in sorted(drawn) for path in drawn[place]]


def _columns(runs: Mapping[int, Mapping[str, Scores]]) -> dict[str, dict[str, list[float]]]:
    seeds = sorted(runs)
    columns: dict[str, dict[str, list[float]]] = {}
    for column in runs[seeds[0]]:
        names = runs[seeds[0]][column]
        columns[column] = {
            name: [float(runs[seed][column][name]) for seed in seeds] for name in names
        }
    return columns


def checked_names(names: Sequence[str]) -> list[str]:
    """The experiments asked for (all if none), in the order of the papers.

    Raises:
        ReproductionError: one is not known.
    """
    known = available_experiments()
    for name in names:
        if name not in known:
            raise ReproductionError(f"no experiment {name!r}; known: {', '.join(known)}")
    return [name for name in known if not names or name in names]


def run_campaign(
    names: Sequence[str],
    *,
    seeds: int,
    output: Path,
    workers: int = 2,
    progress: Progress | None = None,
) -> ReproductionResult:
    """Run experiments, or what is missing of them.

    Args:
        names: experiments; none for all.
        seeds: how many seeds, counted from 1.
        output: folder for the results; made if it does not exist. Pictures go to its `pictures`.
        workers: processes.
        progress: told about each finished seed.

    Raises:
        ReproductionError: an unknown name, a number below 1, or a folder that cannot be written.
    """
    chosen = checked_names(names)
    if seeds < 1:
        raise ReproductionError(f"seeds is {seeds}, must be at least 1")
    if workers < 1:
        raise ReproductionError(f"workers is {workers}, must be at least 1")
    folder, pictures = output / "runs", output / "pictures"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pictures.mkdir(exist_ok=True)
    except OSError as error:
        raise ReproductionError(f"cannot write to {output}: {error.strerror}") from None
    wanted = range(FIRST_SEED, FIRST_SEED + seeds)
    kept: Runs = {}
    for name in chosen:
        path, mark = folder / f"{name}.jsonl", fingerprint(name)
        kept[name] = _stored(path, mark)
        _write(path, mark, kept[name])
    missing = {name: [s for s in wanted if s not in kept[name]] for name in chosen}

    def tell(name: str) -> None:
        if progress is not None:
            progress(name, sum(s in kept[name] for s in wanted), seeds)

    def finished(name: str, runs: dict[int, dict[str, Scores]]) -> None:
        _append(folder / f"{name}.jsonl", runs)
        kept[name] |= runs
        tell(name)

    for name in chosen:
        tell(name)
    drawn = _compute(_tasks(missing), chosen, pictures, workers, finished)
    return ReproductionResult(
        {
            name: ExperimentResult(
                name,
                list(wanted),
                _columns({seed: kept[name][seed] for seed in wanted}),
                identifiable(name),
                floors(name),
            )
            for name in chosen
        },
        output,
        drawn,
    )
