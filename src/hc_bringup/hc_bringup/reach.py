"""How the commands speak with nodes: as the nodes do among themselves."""

from __future__ import annotations

from hc_bringup.errors import WRONG_USE, UserError
from hc_msgs_py.middleware import NoDomainError, NoSecurityError, set_defaults


def speak_to_nodes() -> None:
    """Set the environment of the middleware, before ROS is initialised.

    Raises:
        UserError: if ROS_DOMAIN_ID is no domain, or security is asked for that the middleware does
            not have.
    """
    try:
        set_defaults()
    except (NoDomainError, NoSecurityError) as error:
        raise UserError(str(error), WRONG_USE) from error
