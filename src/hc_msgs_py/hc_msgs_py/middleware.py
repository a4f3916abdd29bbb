"""Defaults of the middleware, set through the environment before ROS is initialised.

Without a word from the user, nodes speak on this machine only, bound to 127.0.0.1. What the user
has set (a wider range, static peers, a profile of one's own) stays as it is.
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from typing import Final

THIS_MACHINE: Final = Path(__file__).with_name("fast_dds_this_machine.xml")
NETWORK: Final = Path(__file__).with_name("fast_dds.xml")
RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
LEFT_TO_PROFILE: Final = "SYSTEM_DEFAULT"
"""Range with which the ROS layer adds nothing to the profile (see fast_dds_this_machine.xml)."""
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_NO_SECURITY: Final = b"doesn't have the security libraries"
_LOG_FOLDERS: Final = ("ROS_LOG_DIR", "ROS_HOME", "HOME")
"""Where the ROS layer writes logs; it does not start if none of them is set."""
_LOCALHOST: Final = "LOCALHOST"
_OLD_SWITCH: Final = "ROS_LOCALHOST_ONLY"
_PEERS: Final = "ROS_STATIC_PEERS"


class NoSecurityError(Exception):
    """Security was asked for, and the middleware here has none; one line."""


def set_defaults() -> None:
    """Choose range and profile; children inherit them, and calling it again changes nothing.

    Raises:
        NoSecurityError: if ROS_SECURITY_ENABLE is true and the middleware was built without
            security: it would refuse only where it finds the node's keys, and else run open.
    """
    environment = os.environ
    if environment.get("ROS_SECURITY_ENABLE") == "true":
        library = built_without_security()
        if library is not None:
            raise NoSecurityError(
                f"ROS_SECURITY_ENABLE is true, and the middleware was built without security "
                f"({library}): see docs/security.md, or unset the variable"
            )
    if not any(environment.get(name) for name in _LOG_FOLDERS):  # a service may have no home
        environment["ROS_LOG_DIR"] = str(Path(tempfile.gettempdir()) / f"ros_log_{os.getuid()}")
    profile = next((environment[n] for n in _PROFILE_VARIABLES if environment.get(n)), None)
    if profile not in (None, str(THIS_MACHINE), str(NETWORK)):
        environment.setdefault(RANGE, _LOCALHOST)
        return
    if _this_machine_only(profile):
        environment.pop(_OLD_SWITCH, None)  # it would win over the range
        environment[RANGE] = LEFT_TO_PROFILE
        environment[_PROFILE_VARIABLES[0]] = str(THIS_MACHINE)
    else:
        # Without shared memory here too, unless asked for: killed nodes leave nothing in the way.
        environment.setdefault("FASTDDS_BUILTIN_TRANSPORTS", "UDPv4")
        environment[_PROFILE_VARIABLES[0]] = str(NETWORK)


def built_without_security() -> Path | None:
    """Return the library of the middleware if it cannot secure anything, else None.

    Compiled without security, it carries the text of the error that it then answers with.
    """
    folders = [
        *os.environ.get("LD_LIBRARY_PATH", "").split(os.pathsep),
        *(f"{prefix}/lib" for prefix in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)),
        f"{sys.prefix}/lib",
    ]
    for folder in filter(None, folders):
        library = Path(folder) / "librmw_fastrtps_shared_cpp.so"
        if library.is_file():
            return library if _NO_SECURITY in library.read_bytes() else None
    return None


def _this_machine_only(profile: str | None) -> bool:
    """Whether the range is this machine, given the profile of ours that was inherited, if any."""
    if os.environ.get(_OLD_SWITCH) == "1":
        return True
    chosen = os.environ.get(RANGE) or _LOCALHOST
    if chosen == LEFT_TO_PROFILE:
        return profile == str(THIS_MACHINE)
    return chosen == _LOCALHOST and not os.environ.get(_PEERS)
