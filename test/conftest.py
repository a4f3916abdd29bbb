"""What the tests of all packages share: a ROS domain of one's own, and two hosts on one machine."""

import fcntl
import gc
import os
import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

# The same examples in every ordinary run, so that a failure is one of the change and not of the
# dice. New ones: `./hc test -- --hypothesis-profile exploring`. The time that an example takes
# says nothing on a machine that others use too.
settings.register_profile("ordinary", derandomize=True, deadline=None, print_blob=True)
settings.register_profile("exploring", derandomize=False, deadline=None, print_blob=True)
settings.load_profile("ordinary")

MIDDLEWARE_VARIABLES = (
    "ROS_AUTOMATIC_DISCOVERY_RANGE",
    "FASTRTPS_DEFAULT_PROFILES_FILE",
    "FASTDDS_BUILTIN_TRANSPORTS",
)
HIGHEST_DOMAIN = 101  # above it the ports of DDS leave the range that Linux keeps free


def depends_on_the_machine(item: pytest.Item) -> bool:
    """Whether a test has processes of its own, speaks over the middleware or waits by the clock."""
    marked = item.get_closest_marker("process") or item.get_closest_marker("clock")
    return marked is not None or "ros_domain" in getattr(item, "fixturenames", ())


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests that wait first, so that the many short ones even out the workers in the end.

    They alone are tried again, twice at most: a machine that others use stalls for seconds now and
    then. Whatever only computes gives the same result each time, and a failure of it is one.
    """
    items.sort(key=lambda item: not depends_on_the_machine(item))
    for item in items:
        if depends_on_the_machine(item):
            item.add_marker(pytest.mark.flaky(reruns=2))


@pytest.fixture(autouse=True)
def middleware_environment() -> Iterator[None]:
    """What hc_msgs_py.middleware sets for this process ends with the test."""
    before = {name: os.environ.get(name) for name in MIDDLEWARE_VARIABLES}
    yield
    for name, value in before.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value


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
            # A participant of this process that outlived its test takes messages from the next one.
            gc.collect()
            os.close(descriptor)
        return
    pytest.fail(f"all {HIGHEST_DOMAIN} ROS domains are in use by other tests")


@pytest.fixture
def join_hosts(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Any]]:
    """Make two hosts (network namespaces) and the link between them; see delayed_link.py."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    import delayed_link

    reason = delayed_link.why_not()
    if reason:
        pytest.skip(reason)
    with ExitStack() as stack:
        yield lambda *delay, **loss: stack.enter_context(delayed_link.DelayedLink(*delay, **loss))
