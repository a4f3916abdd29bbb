"""`hc setup` as a user meets it: a terminal, questions, and a robot that presses when asked."""

import signal

import pytest
import yaml

pytestmark = [pytest.mark.slow, pytest.mark.process, pytest.mark.timeout(600)]

ROBOT = {
    "on_request": 4,
    "lift_mm": 3.0,
    "force": {"bias": [0.3, -1.1, 4.2], "reaction": -1, "late_s": 0.02},
}


def press(robot):
    robot.send_signal(signal.SIGUSR1)


def rest_and_press(user, robot):
    user.wait_for("near the tissue; then press Enter")
    user.type("\n")
    user.wait_for("Now press into the tissue")
    press(robot)
    user.wait_for(r"felt: force changed by \d")


def test_a_whole_session_from_questions_to_the_run_that_knows_the_tissue(bench):
    robot = bench.robot(**ROBOT)
    with bench.terminal("setup") as user:
        user.wait_for(r"looking for sensors")
        user.wait_for(r"force: /ft_sensor/wrench")
        user.wait_for(r"position: /tool_pose")
        rest_and_press(user, robot)
        user.wait_for(r"the force is (19|20)\.\d ± [\d.]+ ms late .*\(allowed for\)")
        user.wait_for("write this to my_robot.yaml .*end \\[q\\]\\?")
        user.type("certainly\n")
        user.wait_for("'certainly' is no answer here; type one of: Enter, y, yes, r, b, q")
        user.wait_for("end \\[q\\]\\?")
        user.type("r\n")
        rest_and_press(user, robot)
        user.wait_for("end \\[q\\]\\?")
        user.type("\n")
        user.wait_for("written: my_robot.yaml, my_robot_run.yaml")
        user.wait_for("start a run with it now\\? \\[Y/n\\]")
        user.type("\n")
        user.wait_for(r"[1-9]\d\d Hz")
        press(robot)
        user.wait_for(r"in contact")
        for symbol in "KBnp":
            user.wait_for(rf"{symbol} +\d.* (9\d|100) %")
        for _ in range(4):
            user.wait_for("in contact")
            user.wait_for("in the air")
        user.type("q")
        told = {}
        for symbol in "KBnp":
            told[symbol] = float(user.wait_for(rf"\n +{symbol} = (\S+) +± ")[1])
        assert user.status() == 0, user.seen[-3000:]
        assert "Traceback" not in user.seen
    assert told["K"] == pytest.approx(0.5, rel=0.05)
    assert told["B"] == pytest.approx(0.05, rel=0.15)
    assert told["n"] == pytest.approx(1.5, rel=0.05)
    assert told["p"] == pytest.approx(1.0, rel=0.1)
    settings = yaml.safe_load((bench.folder / "my_robot.yaml").read_text())
    found = settings["estimator"]["ros__parameters"]["input"]
    force, position = found["force"], found["position"]
    assert (force["axis"], force["sign"]) == ("z", -1)
    assert force["zero"] == pytest.approx(-4.2, abs=0.02)
    assert force["time_offset"] == pytest.approx(-0.02, abs=0.001)
    assert (position["type"], position["axis"], position["sign"]) == ("pose", "z", -1)
    assert position["zero"] == pytest.approx(-200.0, abs=0.1)


QUESTIONS = {
    "rest": ["near the tissue; then press Enter"],
    "resting": ["near the tissue; then press Enter", "let it rest"],
    "pressing": ["near the tissue; then press Enter", "waiting for the first press"],
}


@pytest.mark.parametrize("where", QUESTIONS)
def test_ctrl_c_ends_it_with_one_line_wherever_it_comes(bench, where):
    bench.robot(**ROBOT)
    with bench.terminal("setup") as user:
        for question in QUESTIONS[where]:
            user.wait_for(question)
            if "Enter" in question and where != "rest":
                user.type("\n")
        user.type("\x03")
        assert user.status() == 130
        assert "hc setup: ended: nothing was written" in user.seen
        assert "Traceback" not in user.seen
    assert not list(bench.folder.glob("my_robot*"))


def test_who_presses_meanwhile_is_told_and_a_sensor_that_dies_is_named_and_may_come_back(bench):
    robot = bench.robot(**ROBOT)
    with bench.terminal("setup") as user:
        user.wait_for("near the tissue; then press Enter")
        press(robot)
        user.type("\n")
        user.wait_for(r"the force changed by [\d.]+ N meanwhile .*in the air\?")
        user.wait_for(r"go on all the same \[g\]\?")
        user.type("g\n")
        user.wait_for("several times, slow and fast")
        robot.send_signal(signal.SIGUSR2)
        user.wait_for(r"/ft_sensor/wrench has sent nothing for \d+ s: is its driver still running")
        user.wait_for(r"or end \[q\]\?")
        user.type("b\n")
        user.wait_for(r"no force topic of type WrenchStamped sends anything")
        user.wait_for(r"look again\? \[Y/n\]")
        bench.robot(**ROBOT)
        user.type("\n")
        user.wait_for("near the tissue; then press Enter")
        user.type("\x04")
        assert user.status() == 1
        assert "hc setup: the input ended: nothing more was done" in user.seen
    assert not list(bench.folder.glob("my_robot*"))


def test_a_look_alike_without_stamps_is_named_and_why_it_does_not_do(bench):
    script = (
        "import rclpy, time; from geometry_msgs.msg import Wrench; rclpy.init();"
        "n = rclpy.create_node('bare'); p = n.create_publisher(Wrench, 'bare', 10)\n"
        "while True: p.publish(Wrench()); time.sleep(0.01)"
    )
    bench.start("-c", script)
    done = bench.hc("setup", "--yes")
    assert done.returncode == 1
    assert "carries no time of measurement; let its driver publish the type Wrench" in done.stdout
    assert done.stderr.count("\n") == 1


def test_among_several_sensors_the_number_is_asked_for_until_it_is_one(bench):
    robot = bench.robot(**ROBOT)
    script = """if True:
        import rclpy, time
        from rclpy.qos import QoSProfile, DurabilityPolicy
        from geometry_msgs.msg import PoseStamped, WrenchStamped
        rclpy.init()
        node = rclpy.create_node("other")
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        force = node.create_publisher(WrenchStamped, "base/wrench", latched)
        pose = node.create_publisher(PoseStamped, "camera_pose", latched)
        while True:
            force.publish(WrenchStamped())
            pose.publish(PoseStamped())
            time.sleep(0.02)
    """
    bench.start("-c", script)
    with bench.terminal("setup") as user:
        found = user.wait_for(
            r"(no position topic|number of the force topic \[Enter: /ft_sensor/wrench\])"
        )
        assert found[1].startswith("number"), user.seen
        user.type("7\n")
        user.wait_for(r"'7' is no answer here; type one of: Enter, 1, 2")
        user.wait_for("number of the force topic")
        user.type("1\n")
        user.wait_for(r"number of the position topic \[Enter: /tool_pose\]")
        user.type("\n")
        user.wait_for("near the tissue; then press Enter")
        user.type("\n")
        user.wait_for("Now press into the tissue")
        press(robot)  # which the chosen sensor, that of the base, does not feel
        user.wait_for(r"waiting for the first press \(5\d s\): force changed by 0 N .*moved [1-9]")
        user.type("\x03")
        assert user.status() == 130
