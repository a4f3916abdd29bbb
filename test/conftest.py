"""What the tests of all packages share: a ROS domain that no other test uses at the same time."""

import fcntl
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

HIGHEST_DOMAIN = 101  # above it the ports of DDS leave the range that Linux keeps free


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Id of a ROS domain that is this test's own until it ends.

    Tests run on several processes, and several people may test on one machine: who holds the lock
    on a domain's file has the domain.
    """
    folder = Path(tempfile.gettempdir()) / f"hc_test_domains_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for number in range(1, HIGHEST_DOMAIN + 1):
        descriptor = os.open(folder / str(number), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            continue
        try:
            yield number
        finally:
            os.close(descriptor)
        return
    pytest.fail(f"all {HIGHEST_DOMAIN} ROS domains are in use by other tests")
