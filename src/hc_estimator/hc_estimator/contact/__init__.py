"""Contact laws: the force that a tissue answers to a penetration and its velocity."""

from hc_estimator.contact.elastic_power_law import elastic_power_law_force
from hc_estimator.contact.hunt_crossley import adhesive_force, hunt_crossley_force
from hc_estimator.contact.kelvin_boltzmann import kelvin_boltzmann_force
from hc_estimator.contact.kelvin_voigt import kelvin_voigt_force

__all__ = [
    "adhesive_force",
    "elastic_power_law_force",
    "hunt_crossley_force",
    "kelvin_boltzmann_force",
    "kelvin_voigt_force",
]
