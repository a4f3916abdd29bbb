"""What the tests of all packages share: a ROS domain of one's own, and two hosts on one machine."""

import fcntl
import gc
import os
import signal
import tempfile
from collections.abc import Callable, Generator, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from hc_msgs_py.node_processes import Processes

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


WHY_AGAIN = {
    "process": "it starts processes, which a stalled machine starts late",
    "clock": "it waits by the clock, and a stalled machine wakes it late",
    "ros_domain": "it speaks over the middleware, whose discovery a stalled machine delays",
}
"""Why a test with that marker, or that fixture, is tried again: there is no other reason."""


def why_again(item: pytest.Item) -> str:
    """Why a test may fail for what is not its own fault; nothing for those that only compute."""
    for name, reason in WHY_AGAIN.items():
        if item.get_closest_marker(name) or name in getattr(item, "fixturenames", ()):
            return reason
    return ""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put tests that wait first, so that the many short ones even out the workers in the end.

    They alone are tried again, twice at most: a machine that others use stalls for seconds now and
    then. Whatever only computes gives the same result each time, and a failure of it is one.
    """
    items.sort(key=lambda item: not why_again(item))
    for item in items:
        reason = why_again(item)
        if reason:
            item.add_marker(pytest.mark.flaky(reruns=2))
            item.user_properties.append(("tried again because", reason))


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Look for no garbage while tests are collected, and later not among what stays to the end.

    Modules, tests and kernels are hardly ever garbage: a fifth of the collection's time went there.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()


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


@contextmanager
def _free_domain() -> Iterator[int]:
    """Id of a ROS domain that is this test's own until it ends.

    Tests run on several processes, and several people may test on one machine: who holds the lock
    on a domain's file has the domain. The folder is the same for all, whatever their TMPDIR.
    """
    place = "/tmp" if os.access("/tmp", os.W_OK) else tempfile.gettempdir()
    folder = Path(place) / f"hc_test_domains_{os.getuid()}"
    folder.mkdir(exist_ok=True)
    for number in range(1, HIGHEST_DOMAIN + 1):
        descriptor = os.open(folder / str(number), os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            continue
        # A participant of this process that outlived its test takes messages from the next one, so
        # what the test leaves is collected. What was there before is not: that takes 0.25 s.
        gc.freeze()
        try:
            yield number
        finally:
            gc.collect()
            os.close(descriptor)
        return
    pytest.fail(f"all {HIGHEST_DOMAIN} ROS domains are in use by other tests")


@pytest.fixture
def ros_domain() -> Iterator[int]:
    """Id of a ROS domain that is this test's own."""
    with _free_domain() as number:
        yield number


@pytest.fixture
def other_domain(ros_domain: int) -> Iterator[int]:
    """A second one."""
    with _free_domain() as number:
        yield number


@pytest.fixture
def hears_hangups() -> Iterator[None]:
    """Under nohup SIGHUP is ignored, in every process that is started as well; not in this test."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def processes(ros_domain: int, hears_hangups: None) -> Iterator[Processes]:
    """Starts processes in the test's domain; they end with the test."""
    with Processes(ros_domain) as started:
        yield started


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
