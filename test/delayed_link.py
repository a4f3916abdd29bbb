"""Two network namespaces joined by a link with delay and loss: two hosts far apart, on one.

A TAP device in each namespace; what goes into one comes out of the other after N(mean, deviation),
in order, or not at all. Needs root, `ip` and /dev/net/tun, no kernel module for delays.
"""

from __future__ import annotations

import collections
import fcntl
import os
import random
import select
import struct
import subprocess
import threading
import time

TUNSETIFF = 0x400454CA
TAP_WITHOUT_HEADER = 0x0002 | 0x1000
LARGEST_FRAME = 4096


def why_not() -> str:
    """Why namespaces cannot be made here; empty if they can."""
    if os.geteuid() != 0:
        return "needs root for network namespaces"
    try:
        os.close(os.open("/dev/net/tun", os.O_RDWR))
    except OSError as error:
        return f"needs /dev/net/tun: {error.strerror}"
    name = f"hc_try_{os.getpid()}"
    try:
        subprocess.run(["ip", "netns", "add", name], check=True, capture_output=True)
        subprocess.run(["ip", "netns", "del", name], check=True, capture_output=True)
    except FileNotFoundError:
        return "needs the command ip"
    except subprocess.CalledProcessError as error:
        return f"namespaces are not allowed here: {error.stderr.decode().strip()}"
    return ""


class DelayedLink:
    """Makes two namespaces and joins them; a context manager that leaves nothing behind."""

    def __init__(self, mean_s: float, deviation_s: float = 0.0, loss: float = 0.0) -> None:
        self.namespaces = (f"hc_a_{os.getpid()}", f"hc_b_{os.getpid()}")
        self.addresses = ("10.77.0.1", "10.77.0.2")
        self.frames = 0
        self._delay = (mean_s, deviation_s)
        self._loss = loss
        self._random = random.Random(1)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._carry)
        self._taps: list[int] = []

    def __enter__(self) -> DelayedLink:
        try:
            for namespace, address in zip(self.namespaces, self.addresses, strict=True):
                ip("netns", "add", namespace)
                self._taps.append(open_tap(f"hctap{len(self._taps)}", namespace, address))
        except BaseException:
            self.__exit__()
            raise
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        if self._thread.ident is not None:
            self._thread.join()
        for tap in self._taps:
            os.close(tap)
        for namespace in self.namespaces:
            subprocess.run(["ip", "netns", "del", namespace], check=False, capture_output=True)

    def _carry(self) -> None:
        first, second = self._taps
        other = {first: second, second: first}
        waiting: dict[int, collections.deque[tuple[float, bytes]]] = {
            first: collections.deque(),
            second: collections.deque(),
        }
        while not self._stop.is_set():
            now = time.monotonic()
            due = min((queue[0][0] for queue in waiting.values() if queue), default=now + 0.1)
            readable, _, _ = select.select(self._taps, [], [], max(0.0, min(due - now, 0.1)))
            for tap in readable:
                self._read(tap, waiting[other[tap]])
            now = time.monotonic()
            for tap, queue in waiting.items():
                while queue and queue[0][0] <= now:
                    os.write(tap, queue.popleft()[1])
                    self.frames += 1

    def _read(self, tap: int, queue: collections.deque[tuple[float, bytes]]) -> None:
        try:
            while True:
                frame = os.read(tap, LARGEST_FRAME)
                if self._random.random() < self._loss:
                    continue
                due = time.monotonic() + max(0.0, self._random.gauss(*self._delay))
                queue.append((max(due, queue[-1][0]) if queue else due, frame))
        except BlockingIOError:
            return


def open_tap(name: str, namespace: str, address: str) -> int:
    """Make a TAP device in a namespace and return its file descriptor."""
    tap = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(tap, TUNSETIFF, struct.pack("16sH22x", name.encode(), TAP_WITHOUT_HEADER))
    ip("link", "set", name, "netns", namespace)
    inside = ("netns", "exec", namespace, "ip")
    ip(*inside, "link", "set", "lo", "up")
    ip(*inside, "addr", "add", f"{address}/24", "dev", name)
    ip(*inside, "link", "set", name, "up")
    ip(*inside, "route", "add", "239.0.0.0/8", "dev", name)
    return tap


def ip(*arguments: str) -> None:
    """Run `ip` and fail loudly."""
    subprocess.run(["ip", *arguments], check=True, capture_output=True)
