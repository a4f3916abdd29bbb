"""Online estimators of the Hunt-Crossley contact parameters, and their node."""

from hc_msgs_py import starting  # noqa: F401

# isort: split
from hc_estimator.array import EstimatesOfChannels, EstimatorArray
from hc_estimator.estimate import PARAMETER_NAMES, Estimate, EstimateSeries, Hypothesis, Rejection
from hc_estimator.estimator import Estimator, create_estimator
from hc_estimator.kinds import (
    DEFAULT_FILTER,
    available_contact_models,
    available_filters,
    available_state_spaces,
    filter_summary,
    parameter_specifications,
)
from hc_estimator.specification import ParameterSpecification, ParameterValue

__version__ = "0.1.0"

__all__ = [
    "DEFAULT_FILTER",
    "PARAMETER_NAMES",
    "Estimate",
    "EstimateSeries",
    "EstimatesOfChannels",
    "Estimator",
    "EstimatorArray",
    "Hypothesis",
    "ParameterSpecification",
    "ParameterValue",
    "Rejection",
    "available_contact_models",
    "available_filters",
    "available_state_spaces",
    "create_estimator",
    "filter_summary",
    "parameter_specifications",
]
