"""The experiments of the three papers, side by side with what they printed.

result = run_reproduction(["a_table_1"], seeds=100, output=Path("out"))
print(markdown(result))
"""

from hc_evaluation.reproduction.campaign import (
    ExperimentResult,
    ReproductionError,
    ReproductionResult,
)
from hc_evaluation.reproduction.entry import run_reproduction
from hc_evaluation.reproduction.experiment import (
    Experiment,
    ExperimentError,
    available_experiments,
    load_experiment,
)
from hc_evaluation.reproduction.page import markdown

__all__ = [
    "Experiment",
    "ExperimentError",
    "ExperimentResult",
    "ReproductionError",
    "ReproductionResult",
    "available_experiments",
    "load_experiment",
    "markdown",
    "run_reproduction",
]
