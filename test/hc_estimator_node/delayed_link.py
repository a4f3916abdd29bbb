"""A link between two network namespaces that delays every frame and loses some of them.

Two TAP devices, one in each namespace, and this process between them (the kernel's own emulation,
netem, is not everywhere). Prints "up" when frames can flow, and runs until it is ended.

    python delayed_link.py NAMESPACE ADDRESS NAMESPACE ADDRESS DELAY_S LOSS
"""

import fcntl
import heapq
import os
import random
import select
import signal
import struct
import subprocess
import sys
import time

_TUNSETIFF = 0x400454CA
_TAP_WITHOUT_HEADER = 0x0002 | 0x1000


def make_tap(namespace: str, address: str) -> int:
    """Make a TAP device in a namespace and return its file descriptor."""
    name = f"tap{os.getpid() % 100000}{namespace[-1]}"
    descriptor = os.open("/dev/net/tun", os.O_RDWR | os.O_NONBLOCK)
    fcntl.ioctl(descriptor, _TUNSETIFF, struct.pack("16sH22x", name.encode(), _TAP_WITHOUT_HEADER))
    subprocess.run(["ip", "link", "set", name, "netns", namespace], check=True)
    for command in (
        ["link", "set", "lo", "up"],
        ["link", "set", name, "up"],
        ["addr", "add", address, "dev", name],
        ["route", "add", "224.0.0.0/4", "dev", name],
    ):
        subprocess.run(["ip", "netns", "exec", namespace, "ip", *command], check=True)
    return descriptor


def relay(first: int, second: int, delay_s: float, loss: float) -> None:
    """Carry frames both ways for ever, in order."""
    peer = {first: second, second: first}
    queue: list[tuple[float, int, int, bytes]] = []
    count = 0
    generator = random.Random(1)
    while True:
        wait_s = max(0.0, queue[0][0] - time.monotonic()) if queue else 1.0
        for descriptor in select.select([first, second], [], [], wait_s)[0]:
            while True:
                try:
                    frame = os.read(descriptor, 65536)
                except BlockingIOError:
                    break
                if generator.random() >= loss:
                    count += 1
                    due = time.monotonic() + delay_s
                    heapq.heappush(queue, (due, count, peer[descriptor], frame))
        now = time.monotonic()
        while queue and queue[0][0] <= now:
            _due, _number, descriptor, frame = heapq.heappop(queue)
            try:
                os.write(descriptor, frame)
            except BlockingIOError:
                continue  # the other side's queue is full: the frame is lost, as on any link


if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    one, one_address, other, other_address, delay, loss_share = sys.argv[1:]
    taps = make_tap(one, one_address), make_tap(other, other_address)
    sys.stdout.write("up\n")
    sys.stdout.flush()
    relay(*taps, float(delay), float(loss_share))
