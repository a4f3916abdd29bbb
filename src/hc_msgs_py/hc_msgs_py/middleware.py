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
HIGHEST_DOMAIN: Final = 232
"""The last one whose ports fit into 16 bits."""
_PROFILE_VARIABLES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
_NO_SECURITY: Final = b"doesn't have the security libraries"
_LOG_FOLDERS: Final = {"ROS_LOG_DIR": "", "ROS_HOME": "log", "HOME": ".ros/log"}
"""Where the ROS layer writes logs: below the first that is set. It starts nowhere else."""
_LOCALHOST: Final = "LOCALHOST"
_OLD_SWITCH: Final = "ROS_LOCALHOST_ONLY"
_PEERS: Final = "ROS_STATIC_PEERS"


class NoSecurityError(Exception):
    """Security was asked for, and the middleware here has none; one line."""


class NoDomainError(Exception):
    """ROS_DOMAIN_ID names no domain; one line."""


def domain_id() -> int:
    """Return the ROS domain of this process.

    Raises:
        NoDomainError: if ROS_DOMAIN_ID is not a number that a domain can have. The ROS layer would
            take the beginning of some of them for another domain, and end without a word at others.
    """
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not (text.isascii() and text.isdigit() and len(text) < 9 and int(text) <= HIGHEST_DOMAIN):
        raise NoDomainError(
            f"ROS_DOMAIN_ID={text[:40]!r} is no domain: give a number from 0 to {HIGHEST_DOMAIN}"
        )
    return int(text)


def set_defaults() -> None:
    """Choose range and profile; children inherit them, and calling it again changes nothing.

    Raises:
        NoDomainError: if ROS_DOMAIN_ID is no domain.
        NoSecurityError: if ROS_SECURITY_ENABLE is true and the middleware was built without
            security: it would refuse only where it finds the node's keys, and else run open.
    """
    domain_id()
    environment = os.environ
    if environment.get("ROS_SECURITY_ENABLE") == "true":
        library = built_without_security()
        if library is not None:
            raise NoSecurityError(
                f"ROS_SECURITY_ENABLE is true, and the middleware was built without security "
                f"({library}): see docs/security.md, or unset the variable"
            )
    _choose_log_folder()
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


def _choose_log_folder() -> None:
    """Let logs go to the system's folder for passing files where they cannot go where they would.

    A service may have no home, or one that is not its own. Of a folder that was named it is said.
    """
    elsewhere = Path(tempfile.gettempdir()) / f"ros_log_{os.getuid()}"
    for name, below in _LOG_FOLDERS.items():
        given = os.environ.get(name)
        if not given:
            continue
        folder = Path(given).expanduser() / below
        why = _why_not_written(folder)
        if not why:
            return
        if name != "HOME":
            sys.stderr.write(f"{name}: cannot write to {folder} ({why}); logs go to {elsewhere}\n")
        break
    os.environ["ROS_LOG_DIR"] = str(elsewhere)


def _why_not_written(folder: Path) -> str:
    """Return why no file can be made in a folder, which is made if need be; else nothing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        return str(error.strerror)
    return "" if os.access(folder, os.W_OK | os.X_OK) else "no permission"


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
