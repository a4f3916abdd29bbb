"""Contact laws: the force that a tissue answers to a penetration and its velocity."""

from hc_estimator.contact.hunt_crossley import hunt_crossley_force

__all__ = ["hunt_crossley_force"]
