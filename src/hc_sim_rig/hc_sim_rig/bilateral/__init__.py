"""Closed-loop teleoperation with a hand, a network, tissue with a lump, and four feedbacks.

    series = simulate(Bilateral(network=Network(round_trip_ms=100.0)), seed=1)

No ROS. Equations, sources, guarantees: docs/teleoperation.md.
"""

from hc_sim_rig.bilateral.layout import METHODS
from hc_sim_rig.bilateral.parts import (
    Bilateral,
    Device,
    Feedback,
    LumpyTissue,
    Network,
    Operator,
    SlaveArm,
)
from hc_sim_rig.bilateral.simulation import BilateralSeries, simulate
from hc_sim_rig.bilateral.task import Task, palpation_task

__all__ = [
    "METHODS",
    "Bilateral",
    "BilateralSeries",
    "Device",
    "Feedback",
    "LumpyTissue",
    "Network",
    "Operator",
    "SlaveArm",
    "Task",
    "palpation_task",
    "simulate",
]
