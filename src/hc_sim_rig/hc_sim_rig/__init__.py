"""Simulated master-slave indenter, and its node.

rig = Rig(load_scenario("multisine"), seed=1)
sample = rig.step()          # one sample
series = rig.run(10.0)       # ten seconds, compiled, the same numbers as step()
"""

from hc_msgs_py import starting  # noqa: F401

# isort: split
from hc_sim_rig.records import Coupling, Joint, RigSample, RigSeries, Truth
from hc_sim_rig.rig import LinkReport, Rig, RigDivergedError
from hc_sim_rig.scenario import Scenario, available_scenarios, load_scenario
from hc_sim_rig.schema import ScenarioError
from hc_sim_rig.settings import SETTINGS, Setting, settings_of

__all__ = [
    "SETTINGS",
    "Coupling",
    "Joint",
    "LinkReport",
    "Rig",
    "RigDivergedError",
    "RigSample",
    "RigSeries",
    "Scenario",
    "ScenarioError",
    "Setting",
    "Truth",
    "available_scenarios",
    "load_scenario",
    "settings_of",
]
