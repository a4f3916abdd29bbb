"""Locks with a name that one process of this machine has, and that never outlive it.

Who has one listens on a socket in the abstract namespace. The kernel lets one process have a name;
it is gone with the process however that ends; and whoever connects is told the process id of its
owner.
"""

from __future__ import annotations

import socket
import struct
from pathlib import Path

_CREDENTIALS = struct.Struct("3i")  # process, user and group id


def take(name: str) -> socket.socket | None:
    """Take a lock; None if another process has it. It is given back when the socket is closed."""
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)  # not inherited by children
    try:
        listener.bind(f"\0{name}")
        listener.listen()
    except OSError:
        listener.close()
        return None
    return listener


def owner_of(name: str) -> tuple[int | None, str]:
    """Say who has a lock: the process id, and in words with what was typed."""
    try:
        with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
            asking.settimeout(1.0)
            asking.connect(f"\0{name}")
            size = _CREDENTIALS.size
            raw = asking.getsockopt(socket.SOL_SOCKET, socket.SO_PEERCRED, size)
    except OSError:  # it has ended just now, or does not answer
        return None, "another process"
    number, _, _ = _CREDENTIALS.unpack(raw)
    try:
        words = Path(f"/proc/{number}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return number, f"process {number}"
    names = [Path(word).name for word in words]
    start = next((i for i, name in enumerate(names) if name in ("hc", "hc_bringup")), None)
    if start is None:
        return number, f"process {number}"
    typed = " ".join(["hc", *words[start + 1 :]]).strip()
    return number, f"process {number} ({''.join(filter(str.isprintable, typed))[:80]})"
