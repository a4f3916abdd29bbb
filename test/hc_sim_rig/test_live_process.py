"""Master and slave as processes: two hosts with a real delay, two domains, and a fake device."""

from __future__ import annotations

import json
import math
import random
import signal
import socket
import subprocess
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hc_msgs.msg import IndenterSample, IndenterTruth
from rclpy.serialization import deserialize_message

from hc_logger.reader import BagReader
from hc_msgs_py.node_processes import Processes
from hc_sim_rig.bilateral.datagrams import MASTER, Datagram
from hc_sim_rig.bilateral.parts import Bilateral
from hc_sim_rig.bilateral.sides import MasterSide, SlaveSide
from hc_sim_rig.bilateral.udp_link import Added, UdpLink

pytestmark = pytest.mark.process
ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
HC = ["-m", "hc_bringup"]
Start = Callable[..., subprocess.Popen]


@pytest.fixture(scope="module")
def compiled() -> None:
    """Compile once, so that no process keeps the other side waiting."""
    link = UdpLink(0, "127.0.0.1", 0, "127.0.0.1", 9, Added(), 1)
    MasterSide(Bilateral(), link).warm_up()
    SlaveSide(Bilateral(), link, -5.0, 1).warm_up()
    link.close()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Start processes in a domain, in a namespace if wanted; ended with the test."""
    with ExitStack() as stack:

        def begin(domain: int, *words: str, through: tuple[str, ...] = (), **more: str) -> Any:
            processes = stack.enter_context(Processes(domain, tmp_path, **more))
            return processes.start(*words, through=through)

        yield begin


@pytest.mark.usefixtures("compiled")
@pytest.mark.slow
def test_two_hosts_feel_through_a_link_with_delay_and_loss(
    start: Start, join_hosts: Callable[..., Any], ros_domain: int, tmp_path: Path
) -> None:
    """`hc run master` and `hc run slave` in two network namespaces, 100 ms and 10 % loss each way.

    Nothing is simulated of the way between. The slave's host has a clock that is 40 s ahead.
    """
    link = join_hosts(0.1, 0.005, loss=0.1)
    shim, offset = clock_shim(tmp_path, 40.0)
    first, second = link.addresses
    ahead = {"LD_PRELOAD": str(shim), "HC_TEST_CLOCK": str(offset)}
    inside = [("ip", "netns", "exec", name) for name in link.namespaces]
    plain = [f"link.added_{name}=0.0" for name in ("delay", "jitter", "loss")]
    slave = start(
        ros_domain,
        *HC,
        *("run", "slave", "--duration", "45", "--json", "--headless", "--bag", "bag"),
        *parameters("slave", f"link.bind={second}", f"link.peer={first}", *plain),
        through=inside[1],
        **ahead,
    )
    master = start(
        ros_domain,
        *HC,
        *("run", "master", "--duration", "60", "--json", "--headless"),
        *parameters("master", f"link.bind={first}", f"link.peer={second}", *plain),
        through=inside[0],
    )
    observer = start(
        ros_domain,
        str(HERE / "live_observer.py"),
        "40",
        through=inside[0],
    )
    told, errors = observer.communicate(timeout=180)
    assert observer.returncode == 0, errors
    found = json.loads(told)
    assert master.wait(timeout=180) == 0, master.communicate()
    assert slave.wait(timeout=180) == 0, slave.communicate()
    status = {name: float(value) for name, value in found["status"].items() if number(value)}
    assert status["round_trip_ms"] > 190.0
    assert status["clock_offset_ms"] == pytest.approx(40_000.0, abs=100.0)
    assert abs(status["clock_offset_ms"] - 40_000.0) <= status["clock_offset_bound_ms"]
    assert status["link_lost"] > 0.03 * status["link_received"]
    assert status["link_refused"] == 0
    assert status["largest_update_n"] <= 20.0 * 1e-3 * (1.0 + 1e-6)
    assert found["force_n"] > 0.2  # the tissue was felt
    assert found["stiffness"] > 0.05  # and there was a model of it


@pytest.mark.usefixtures("compiled")
@pytest.mark.slow
@pytest.mark.parametrize("method", ["observer", "extended", "unscented", "sir_pf"])
def test_without_a_force_sensor_the_force_is_felt_all_the_same(
    start: Start, ros_domain: int, tmp_path: Path, method: str
) -> None:
    """Two ROS domains on one machine; the estimator sees joint position and effort only.

    Scored against the slave's true force, which the bag holds and nobody else is told.
    """
    common = ("--json", "--headless")
    ports = free_ports()
    slave = start(
        ros_domain,
        *HC,
        *("run", "slave", "--duration", "30", "--bag", "bag", *common),
        *parameters("slave", "force_sensor=false", f"link.port={ports[1]}"),
        *parameters("slave", f"link.peer_port={ports[0]}"),
        *("--param", "input.source=effort", "--param", f"input.effort.method={method}"),
    )
    master = start(
        ros_domain + 101,  # the other side's domain
        *HC,
        *("run", "master", "--duration", "40", *common),
        *parameters("master", f"link.port={ports[0]}", f"link.peer_port={ports[1]}"),
    )
    told, errors = slave.communicate(timeout=240)
    assert slave.returncode == 0, errors
    master.send_signal(signal.SIGINT)
    assert json.loads(told)["estimates"] > 3000
    series = read_forces(tmp_path / "bag")
    time, force = series["/indenter/sample"]
    true = np.interp(time, *series["/indenter/truth"])
    assert true.max() > 0.5
    late = time > time[0] + 0.5
    assert np.sqrt(np.mean((force - true)[late] ** 2)) < 0.3


@pytest.mark.usefixtures("compiled")
@pytest.mark.slow
@pytest.mark.parametrize("method", ["position_position", "wave_variables", "direct"])
def test_every_method_of_feedback_runs_live(
    start: Start, ros_domain: int, tmp_path: Path, method: str
) -> None:
    """Two ROS domains, a round trip of 20 ms with jitter and loss: told to the master alone."""
    ports = free_ports()
    added = ("link.added_delay=0.01", "link.added_jitter=0.001", "link.added_loss=0.1")
    slave = start(
        ros_domain,
        *HC,
        *("run", "slave", "--duration", "25", "--json", "--headless", "--bag", "bag"),
        *parameters("slave", f"link.port={ports[1]}", f"link.peer_port={ports[0]}", *added),
    )
    master = start(
        ros_domain + 101,  # the other side's domain
        *HC,
        *("run", "master", "--duration", "35", "--json", "--headless"),
        *parameters("master", f"link.port={ports[0]}", f"link.peer_port={ports[1]}", *added),
        *parameters("master", f"feedback.method={method}"),
    )
    observer = start(ros_domain + 101, str(HERE / "live_observer.py"), "15")
    told, errors = observer.communicate(timeout=180)
    assert observer.returncode == 0, errors
    found = json.loads(told)
    told, errors = slave.communicate(timeout=240)
    assert slave.returncode == 0, errors
    master.send_signal(signal.SIGINT)
    _, true = read_forces(tmp_path / "bag")["/indenter/truth"]
    assert json.loads(told)["estimates"] > 3000
    assert float(found["status"]["link_received"]) > 5000
    assert float(found["status"]["link_refused"]) == 0
    assert found["stiffness"] == 0.0  # no model is rendered
    assert true.max() > 0.5  # the tool was led into the tissue
    assert found["force_n"] > 0.2  # and the hand felt it


def read_forces(bag: Path) -> dict[str, np.ndarray]:
    """Time and force of the samples, which the estimator made of the effort, and of the truth."""
    kinds = {"/indenter/sample": IndenterSample, "/indenter/truth": IndenterTruth}
    rows = {topic: [] for topic in kinds}
    with BagReader(bag) as reader:
        for recorded in reader.messages(set(kinds)):
            message = deserialize_message(recorded.data, kinds[recorded.topic])
            stamp = message.header.stamp
            rows[recorded.topic].append((stamp.sec + 1e-9 * stamp.nanosec, message.force))
    return {topic: np.array(found).T for topic, found in rows.items()}


@pytest.mark.usefixtures("compiled")
@pytest.mark.slow
def test_a_side_that_is_killed_comes_back_through_garbage_with_its_clock_set_back(
    start: Start, ros_domain: int, tmp_path: Path
) -> None:
    """The tool's node is killed and started again with its clock an hour behind; then the hand's.

    All the while strangers send what they like to both ports.
    """
    here, there = free_ports()
    shim, offset = clock_shim(tmp_path, 0.0)
    own_clock = {"LD_PRELOAD": str(shim), "HC_TEST_CLOCK": str(offset)}
    ports = {"master": (here, there), "slave": (there, here)}

    def node(name: str, *more: str, **environment: str) -> subprocess.Popen:
        own, others = ports[name]
        words = (f"link.port:={own}", f"link.peer_port:={others}", *more)
        options = [word for setting in words for word in ("-p", setting)]
        module = f"hc_sim_rig.{name}_node"
        named = ("-m", module, "--ros-args", "-r", f"__node:={name}", *options)
        return start(ros_domain, *named, **environment)

    def observe() -> tuple[dict[str, float], float]:
        told, errors = start(ros_domain, str(HERE / "live_observer.py"), "8").communicate(
            timeout=150
        )
        found = json.loads(told)
        status = {key: float(value) for key, value in found["status"].items() if number(value)}
        assert status, errors
        return status, found["force_n"]

    method = "feedback.method:=direct"
    with strangers(here, there):
        slave, master = node("slave", **own_clock), node("master", method)
        status, force = observe()
        assert status["link_restarts"] == 0
        assert force > 0.2
        slave.kill()
        slave.wait(timeout=20)
        offset.write_bytes(round(-3600e9).to_bytes(8, "little", signed=True))
        slave = node("slave", **own_clock)
        status, force = observe()
        assert status["link_restarts"] == 1
        assert status["link_age_ms"] < 5000.0
        assert abs(status["clock_offset_ms"] + 3.6e6) <= status["clock_offset_bound_ms"]
        assert status["link_refused"] > 100
        assert force > 0.1
        master.kill()
        master.wait(timeout=20)
        master = node("master", method)
        status, force = observe()
        assert status["link_age_ms"] < 5000.0
        assert force > 0.1
    for process in (slave, master):
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=60) == 0


@contextmanager
def strangers(*ports: int) -> Iterator[None]:
    """Somebody who sends nonsense, and datagrams that look well, to ports of this machine."""
    stop = threading.Event()
    dice = random.Random(1)
    good = Datagram(MASTER, 10**6, 0, 0, 0, 50.0, 0.0, 0.0, 5.0).encode()

    def send() -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as source:
            while not stop.wait(0.001):
                data = dice.choice((good, dice.randbytes(dice.randrange(300)), good[:-1], b""))
                source.sendto(data, ("127.0.0.1", dice.choice(ports)))

    thread = threading.Thread(target=send)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@pytest.mark.usefixtures("compiled")
@pytest.mark.slow
@pytest.mark.parametrize("rate_hz", [1000, 4000])
def test_a_haptic_device_of_crtk_is_served_at_1_khz(
    start: Start, ros_domain: int, tmp_path: Path, rate_hz: int
) -> None:
    """A fake device publishes measured_cp at its rate and gets a thousand servo_cf a second.

    By stamps and by the device's own samples: how long they take is the machine's business.
    """
    ports = free_ports()
    master = start(
        ros_domain,
        *("-m", "hc_sim_rig.master_node", "--ros-args", "-r", "__node:=master"),
        *("-p", "device.kind:=crtk", "-p", f"link.port:={ports[0]}"),
        *("-p", f"link.peer_port:={ports[1]}"),
    )
    words = (str(rate_hz), "5", str(ports[0]), str(ports[1]))
    device = start(ros_domain, str(HERE / "fake_device.py"), *words)
    told, errors = device.communicate(timeout=240)
    assert device.returncode == 0, errors
    found = json.loads(told)
    assert found["off_the_grid_ms"] < 1e-3  # one force for each millisecond, none left out ...
    assert found["forces"] > 0.5 * found["forces_wanted"]  # ... but by the device's own queue
    # 0.4 N/mm for 3 mm, pushing out of the tissue: along +z. A force that a busy machine held too
    # long overdraws the tank, and is paid back by the damper, at 20 mm/s.
    damper_n = 0.03 * 20.0 * 1.1 if float(found["master"]["lowest_tank_mj"]) < 0.0 else 0.0
    assert found["force_above_n"] <= damper_n
    assert 1.18 < found["force_largest_n"] <= 1.2 + damper_n + 1e-9
    assert found["force_after_silence_n"] == 0.0
    status = found["master"]
    assert "the haptic device says nothing" in status["message"]
    assert int(status["poses"]) > 1000  # the newest counts, what it overtook does not
    for reason in ("no_number", "out_of_range", "jump"):
        assert int(status[f"poses_refused_{reason}"]) == 0
    master.send_signal(signal.SIGINT)
    assert master.wait(timeout=60) == 0


@pytest.mark.parametrize(
    ("module", "name", "value", "word"),
    [
        ("master", "feedback.method", "telepathy", "is not one of direct, position_position"),
        *(
            pytest.param(*case, marks=pytest.mark.slow)  # the same way out of the same start
            for case in (
                ("slave", "slave.stiffness_low", "50.0", "stiffness_low is 50"),
                ("master", "motion", "/no/such/file.csv", "cannot read the motion"),
                ("slave", "link.bind", "192.0.2.1", "link from 192.0.2.1"),
            )
        ),
    ],
)
def test_nodes_say_in_one_line_what_cannot_be(
    start: Start, ros_domain: int, module: str, name: str, value: str, word: str
) -> None:
    command = ("-m", f"hc_sim_rig.{module}_node", "--ros-args", "-p", f"{name}:={value}")
    process = start(ros_domain, *command)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert word in errors
    assert len(errors.strip().splitlines()) == 1


def parameters(node: str, *settings: str) -> list[str]:
    """Options of hc run for parameters of one node."""
    return [word for setting in settings for word in ("--param", f"{node}.{setting}")]


def number(text: str) -> bool:
    try:
        return math.isfinite(float(text))
    except ValueError:
        return False


def free_ports() -> tuple[int, int]:
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other,
    ):
        one.bind(("127.0.0.1", 0))
        other.bind(("127.0.0.1", 0))
        return one.getsockname()[1], other.getsockname()[1]


def clock_shim(folder: Path, ahead_s: float) -> tuple[Path, Path]:
    """Compile the system clock that a test sets, and set it."""
    library, offset = folder / "clock_shim.so", folder / "offset"
    source = ROOT / "test" / "clock_shim.c"
    command = ["cc", "-shared", "-fPIC", "-O1", "-o", str(library), str(source), "-ldl"]
    try:
        subprocess.run([*command, "-lpthread"], check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"needs cc, to compile test/clock_shim.c: {error}")
    offset.write_bytes(round(ahead_s * 1e9).to_bytes(8, "little", signed=True))
    return library, offset
