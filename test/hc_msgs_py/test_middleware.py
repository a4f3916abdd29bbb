"""Who can be reached: nobody off this machine, unless the user widened the range."""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hc_msgs_py.middleware import (
    NETWORK,
    THIS_MACHINE,
    built_without_security,
    set_defaults,
)
from hc_msgs_py.node_processes import Processes

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILE = "FASTRTPS_DEFAULT_PROFILES_FILE"
VARIABLES = (
    RANGE,
    PROFILE,
    "FASTDDS_DEFAULT_PROFILES_FILE",
    "FASTDDS_BUILTIN_TRANSPORTS",
    "ROS_LOCALHOST_ONLY",
    "ROS_STATIC_PEERS",
)
OURS = {RANGE: "SYSTEM_DEFAULT", PROFILE: str(THIS_MACHINE)}
WIDE = {PROFILE: str(NETWORK), "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}

NODE = """
import sys
from rclpy.node import Node
from hc_msgs_py.node_main import run_node
class Example(Node):
    def __init__(self):
        super().__init__("example")
        print("up", flush=True)
    def finished(self): return False
    def close(self): pass
sys.exit(run_node(Example))
"""

PROBE = """
import socket, sys
for port in map(int, sys.argv[2:]):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.settimeout(2.0)
        probe.connect((sys.argv[1], port))
        probe.send(b"RTPS")
        try:
            probe.recv(1)
        except ConnectionRefusedError:
            print("refused")
        except TimeoutError:
            print("taken")
"""


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, OURS),
        ({RANGE: ""}, OURS),
        ({RANGE: "LOCALHOST"}, OURS),
        (OURS, OURS),  # inherited from a process of the suite
        ({RANGE: "LOCALHOST", PROFILE: str(NETWORK)}, OURS),
        ({"ROS_LOCALHOST_ONLY": "1", RANGE: "SUBNET"}, OURS),
        ({RANGE: "SUBNET"}, {RANGE: "SUBNET"} | WIDE),
        ({RANGE: "SUBNET", PROFILE: str(THIS_MACHINE)}, {RANGE: "SUBNET"} | WIDE),
        ({RANGE: "SYSTEM_DEFAULT"}, {RANGE: "SYSTEM_DEFAULT"} | WIDE),
        ({"ROS_STATIC_PEERS": "other"}, {"ROS_STATIC_PEERS": "other"} | WIDE),
        ({PROFILE: "own.xml"}, {PROFILE: "own.xml", RANGE: "LOCALHOST"}),
        ({PROFILE: "own.xml", RANGE: "OFF"}, {PROFILE: "own.xml", RANGE: "OFF"}),
    ],
)
def test_the_range_chooses_the_profile(
    monkeypatch: pytest.MonkeyPatch, given: dict[str, str], expected: dict[str, str]
) -> None:
    for name in VARIABLES:
        monkeypatch.delenv(name, raising=False)
    for name, value in given.items():
        monkeypatch.setenv(name, value)
    for _ in range(2):
        set_defaults()
        assert {name: os.environ[name] for name in VARIABLES if name in os.environ} == expected


def bound_addresses(process_id: int, namespace: str) -> list[tuple[str, int]]:
    """Local addresses of all UDP and TCP sockets of a process, as ss sees them."""
    done = subprocess.run(
        ["ip", "netns", "exec", namespace, "ss", "-Hlntup"],
        capture_output=True,
        text=True,
        timeout=10,
        check=True,
    )
    found = []
    for line in done.stdout.splitlines():
        if f"pid={process_id}," in line:
            address, _, port = line.split()[4].rpartition(":")
            found.append((address, int(port)))
    return found


@pytest.mark.process
def test_nothing_answers_on_a_second_interface(
    join_hosts, ros_domain: int, processes: Processes
) -> None:
    """A host with a network: every socket of a node is on 127.0.0.1, and its ports are deaf."""
    link = join_hosts(0.0)
    environment = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    process = processes.launch(
        ["ip", "netns", "exec", link.namespaces[0], sys.executable, "-c", NODE],
        env=environment | {"ROS_DOMAIN_ID": str(ros_domain)},
    )
    try:
        assert process.stdout.readline() == "up\n"
        time.sleep(0.3)
        bound = bound_addresses(process.pid, link.namespaces[0])
        first = 7400 + 250 * ros_domain
        assert any(first <= port < first + 250 for _, port in bound), bound
        assert {address for address, _ in bound} == {"127.0.0.1"}
        # No shared memory either, which every user of the machine could read.
        assert "/dev/shm/fastrtps" not in Path(f"/proc/{process.pid}/maps").read_text()
        ports = [str(port) for _, port in bound]
        probe = subprocess.run(
            [
                *("ip", "netns", "exec", link.namespaces[1]),
                *(sys.executable, "-c", PROBE, link.addresses[0], *ports),
            ],
            capture_output=True,
            text=True,
            timeout=30,
            check=True,
        )
        assert probe.stdout.split() == ["refused"] * len(ports)
    finally:
        process.send_signal(signal.SIGINT)
        _, errors = process.communicate(timeout=20)
    assert (process.returncode, errors) == (0, "")


@pytest.mark.slow
@pytest.mark.process
def test_two_hosts_over_addresses_of_their_own(
    join_hosts, ros_domain: int, processes: Processes, tmp_path: Path
) -> None:
    """What docs/security.md offers for a tunnel: they see each other, and no other interface."""
    link = join_hosts(0.0)
    text = THIS_MACHINE.read_text(encoding="utf-8")
    environments = []
    for own, other in (link.addresses, link.addresses[::-1]):
        profile = tmp_path / f"{own}.xml"
        listed = "<interfaceWhiteList>"
        mine = text.replace(listed, f"{listed}<address>{own}</address>")
        listed = "<initialPeersList>"
        peer = f"<locator><udpv4><address>{other}</address></udpv4></locator>"
        profile.write_text(mine.replace(listed, listed + peer), encoding="utf-8")
        kept = {k: v for k, v in os.environ.items() if k not in VARIABLES}
        chosen = {PROFILE: str(profile), RANGE: "SYSTEM_DEFAULT", "ROS_DOMAIN_ID": str(ros_domain)}
        environments.append(kept | chosen)
    process = processes.launch(
        ["ip", "netns", "exec", link.namespaces[0], sys.executable, "-c", NODE],
        env=environments[0],
    )
    try:
        assert process.stdout.readline() == "up\n"
        listing = [sys.executable, "-m", "hc_bringup", "node", "list"]
        seen = subprocess.run(
            ["ip", "netns", "exec", link.namespaces[1], *listing],
            env=environments[1],
            capture_output=True,
            text=True,
            timeout=60,
            check=True,
        )
        assert seen.stdout == "/example\n"
        bound = bound_addresses(process.pid, link.namespaces[0])
        assert {address for address, _ in bound} == {"127.0.0.1", link.addresses[0]}
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)


@pytest.mark.process
def test_a_node_of_others_is_heard_and_heard_by(
    ros_domain: int, processes: Processes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A node with ROS's own defaults (any network, shared memory) and one of ours, both ways."""
    pair = """
import os, sys, time
if sys.argv[1] == "ours":
    from hc_msgs_py.middleware import set_defaults
    set_defaults()
import rclpy
from std_msgs.msg import String
rclpy.init()
node = rclpy.create_node(sys.argv[1])
publisher = node.create_publisher(String, "said_by_" + sys.argv[1], 10)
heard = []
node.create_subscription(String, "said_by_" + sys.argv[2], lambda m: heard.append(m.data), 10)
end = time.monotonic() + 20
while time.monotonic() < end:
    publisher.publish(String(data="done" if heard else "here"))
    rclpy.spin_once(node, timeout_sec=0.05)
    if "done" in heard:
        end = min(end, time.monotonic() + 0.5)  # the other one wants to hear it too
        heard.clear()
        heard.append("both")
print("both" in heard)
"""
    environment = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    environment["ROS_DOMAIN_ID"] = str(ros_domain)
    both = [
        processes.launch(
            [sys.executable, "-c", pair, *names],
            env=environment,
        )
        for names in (("ours", "others"), ("others", "ours"))
    ]
    assert [p.communicate(timeout=40)[0].strip() for p in both] == ["True", "True"]


def test_security_that_is_not_there_is_refused_and_not_run_without(
    ros_domain: int, tmp_path: Path
) -> None:
    """With no keys for a node and ROS_SECURITY_STRATEGY unset, ROS itself runs it open."""
    if built_without_security() is None:
        pytest.skip("this middleware was built with security")
    (tmp_path / "keystore" / "enclaves").mkdir(parents=True)
    environment = os.environ | {
        "ROS_DOMAIN_ID": str(ros_domain),
        "ROS_SECURITY_ENABLE": "true",
        "ROS_SECURITY_KEYSTORE": str(tmp_path / "keystore"),
    }
    for command in (["-c", NODE], ["-m", "hc_bringup", "node", "list"]):
        done = subprocess.run(
            [sys.executable, *command], env=environment, capture_output=True, text=True, timeout=30
        )
        assert (done.returncode, done.stdout) == (2, "")
        assert "the middleware was built without security" in done.stderr
        assert done.stderr.count("\n") == 1


@pytest.mark.process
def test_a_run_in_a_network_of_its_own_is_out_of_reach_of_other_users(
    ros_domain: int, processes: Processes
) -> None:
    """What docs/security.md offers on one machine: nobody else has this loopback."""
    alone = ["unshare", "--net", "sh", "-c", 'ip link set lo up && exec "$@"', "sh"]
    try:
        allowed = subprocess.run([*alone, "true"], capture_output=True, text=True, timeout=10)
    except FileNotFoundError:
        pytest.skip("needs unshare and ip")
    if allowed.returncode:
        pytest.skip(f"no network of its own is allowed here: {allowed.stderr.strip()}")
    environment = os.environ | {"ROS_DOMAIN_ID": str(ros_domain)}
    process = processes.launch(
        [*alone, sys.executable, "-c", NODE],
        env=environment,
    )
    try:
        assert process.stdout.readline() == "up\n"
        listing = [sys.executable, "-m", "hc_bringup", "node", "list"]
        seen = subprocess.run(
            listing, env=environment, capture_output=True, text=True, timeout=30, check=True
        )
        assert seen.stdout == "no node is running\n"
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=20)


def test_ports_of_the_probe_are_told_apart() -> None:
    """The probe of the test above can tell a socket that listens from one that does not."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        command = [sys.executable, "-c", PROBE, "127.0.0.1", str(port)]
        said = subprocess.run(command, capture_output=True, text=True, timeout=30, check=True)
        assert said.stdout.strip() == "taken"


@pytest.mark.process
@pytest.mark.parametrize("profile", [THIS_MACHINE, NETWORK])
def test_a_reliable_writer_hears_soon_what_its_reader_has(
    ros_domain: int, processes: Processes, profile: Path
) -> None:
    """It asked every 3 s: 3,000 samples were then forgotten at once, and the next one waited."""
    writer_and_reader = """
import sys, time
from hc_msgs_py.middleware import set_defaults
set_defaults()
import rclpy
from rclpy.duration import Duration
from std_msgs.msg import String
from hc_msgs_py.qos import SAMPLE_PUBLISHER_QOS
rclpy.init()
node = rclpy.create_node(sys.argv[1])
if sys.argv[1] == "reader":
    node.create_subscription(String, "said", lambda _message: None, SAMPLE_PUBLISHER_QOS)
    time.sleep(60)
    sys.exit()
publisher = node.create_publisher(String, "said", SAMPLE_PUBLISHER_QOS)
while publisher.get_subscription_count() == 0:
    time.sleep(0.01)
for _ in range(4):
    for _ in range(20):
        publisher.publish(String(data="here"))
        time.sleep(0.001)
    print(publisher.wait_for_all_acked(Duration(seconds=1)))
"""
    environment = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    environment["ROS_DOMAIN_ID"] = str(ros_domain)
    if profile == NETWORK:
        environment[RANGE] = "SUBNET"
    _reader, writer = (
        processes.launch([sys.executable, "-c", writer_and_reader, name], env=environment)
        for name in ("reader", "writer")
    )
    assert writer.communicate(timeout=40)[0].split() == ["True"] * 4


QUEUE = """
import sys, time
from hc_msgs_py.middleware import set_defaults
set_defaults()
import rclpy
from rclpy.qos import QoSProfile
from hc_msgs.msg import IndenterSample
from hc_msgs_py.wire import SampleEncoder
rclpy.init()
depth = int(sys.argv[1])
one, other = rclpy.create_node("one"), rclpy.create_node("other")
publisher = one.create_publisher(IndenterSample, "a", QoSProfile(depth=depth))
subscription = other.create_subscription(
    IndenterSample, "a", print, QoSProfile(depth=depth), raw=True
)
while not publisher.get_subscription_count():
    time.sleep(0.05)
time.sleep(0.3)  # discovery is one-sided
for number in range(depth):
    publisher.publish(SampleEncoder().encode(number, number, 1.0, 1.0))
count = 0
for _ in range(20):
    time.sleep(0.1)
    with subscription.handle as handle:
        while subscription.handle.take_message(IndenterSample, True) is not None:
            count += 1
    if count == depth:
        break
print(count)
"""


@pytest.mark.process
@pytest.mark.parametrize("profile", [THIS_MACHINE, NETWORK])
def test_a_queue_is_as_deep_as_it_was_asked_for(processes: Processes, profile: Path) -> None:
    """Regression: Fast DDS held 5,000 messages, whatever a publisher or the recorder asked for."""
    wide = {} if profile == THIS_MACHINE else {RANGE: "SUBNET"}
    processes.environment = {
        name: value for name, value in processes.environment.items() if name not in VARIABLES
    } | wide
    result = processes.run("-c", QUEUE, "8000")
    assert (result.stdout, result.stderr) == ("8000\n", "")
