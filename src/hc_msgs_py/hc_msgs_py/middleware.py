"""Defaults of the middleware, set through the environment before ROS is initialised.

What the user has set stays as it is.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

PROFILE: Final = Path(__file__).with_name("fast_dds.xml")
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")


def set_defaults() -> None:
    """Keep discovery on this machine, with the profile of fast_dds.xml; children inherit both."""
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if not any(name in os.environ for name in _PROFILE_VARIABLES):
        os.environ[_PROFILE_VARIABLES[0]] = str(PROFILE)
