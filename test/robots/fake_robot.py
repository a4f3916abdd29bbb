"""A robot that publishes what a real one does: rates, frames, signs, units, delays and jitter.

Usage: fake_robot.py SPECIFICATION.json, a dictionary with the keys of DEFAULTS. The tool rests free
of contact for `rest_s`, then presses again and again into a tissue of known parameters.
SIGUSR1 asks one that presses `on_request` to do so; SIGUSR2 ends its force sensor.
"""

import heapq
import json
import math
import random
import signal
import sys
import time

import rclpy
from geometry_msgs.msg import PoseStamped, TransformStamped, WrenchStamped
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from scipy.spatial.transform import Rotation
from sensor_msgs.msg import JointState

from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_estimator.stream.contact_frame import (
    inverse,
    product,
    rotated,
    unit_quaternion,
    unit_vector,
)
from hc_msgs_py.units import set_stamp
from tf2_msgs.msg import TFMessage

GRAVITY = (0.0, 0.0, -9.81)

DEFAULTS = {
    "tissue": [0.5, 0.05, 1.5, 1.0],
    "seed": 1,  # of its noise
    "rest_s": 2.0,
    "on_request": 0,  # if not 0: it presses so many times at each SIGUSR1, and else it rests
    "lift_mm": 3.0,  # so far the tool rests from the surface
    "depth_mm": 4.0,
    "surface": [0.4, 0.1, 0.2],  # m, a point of the tissue's surface in the base frame
    "normal": [0.0, 0.0, 1.0],  # of the surface, out of the tissue
    "attitude": [0.0, 0.0, 0.0, 1.0],  # of the tool in the base frame, quaternion
    "tells_attitude": True,  # else its quaternion is zero
    "rocking_deg": 0.0,  # the tool turns to and fro by so much about its y axis
    "rocking_rate": 0.7,  # rad/s of that motion
    "attitudes": [],  # if given: the tool goes from one to the next and rests 1.5 s in each
    "tip": [0.0, 0.0, 0.0],  # m, of the tool in the frame of the pose
    "reliable": True,
    "clock_s": 0.0,  # so much ahead of this machine is the robot's clock
    "force": {
        "topic": "ft_sensor/wrench",
        "frame": "ft_sensor",
        "rate_hz": 500.0,
        "mounting": [0.0, 0.0, 0.0, 1.0],  # of the sensor in the frame of the tool
        "bias": [0.0, 0.0, 0.0],
        "noise": 0.02,
        "scale": 1.0,  # reading per newton
        "in_base": False,  # told in the base frame
        "reaction": 1,  # 1: the force of the tissue on the tool; -1: that of the tool on the tissue
        "delay_s": 0.0,  # from the measurement to the message
        "late_s": 0.0,  # so much later than the measurement is the stamp
        "jitter_s": 0.0,
        "step": 0.0,  # if not 0: resolution of the reading
    },
    "organ": {  # the surface breathes along its normal, and the tool follows
        "topic": "",  # empty: nothing is told of it
        "breath_mm": 0.0,
        "rate_hz": 60.0,
        "delay_s": 0.0,
        "late_s": 0.0,
        "jitter_s": 0.0,
        "ends_s": 1e9,  # then nothing more is told of it
    },
    "payload": {"mass": 0.0, "center": [0.0, 0.0, 0.0]},
    "position": {
        "type": "pose",
        "topic": "tool_pose",
        "frame": "base",
        "child": "tool",
        "rate_hz": 125.0,
        "joints": [],  # names of joints; the one that presses is "moving", the others wander
        "moving": "",
        "unit_per_m": 1.0,
        "effort": 0,  # if not 0: joints tell their effort, that of the moving one with this sign
        "mass": 0.5,  # kg, that the motor moves
        "noise_mm": 0.005,
        "delay_s": 0.0,
        "late_s": 0.0,
        "jitter_s": 0.0,
    },
}


def merged(given, defaults):
    """The defaults with what is given on top."""
    result = dict(defaults)
    for key, value in given.items():
        result[key] = merged(value, defaults[key]) if isinstance(value, dict) else value
    return result


class Robot:
    """Where the tool is and what it feels at any time.

    Turns vectors as the node does, which is fast; test_contact_frame compares it with scipy.
    """

    def __init__(self, specification):
        self.s = specification
        self.normal = unit_vector(self.s["normal"])
        self.attitude = unit_quaternion(self.s["attitude"])
        self.mounting = unit_quaternion(self.s["force"]["mounting"])
        self.random = random.Random(self.s["seed"])
        self.requests = []  # times at which it was asked to press
        self.force_is_dead = False

    def since_start(self, time_s):
        """For how long the tool has been pressing; 0 while it rests."""
        presses = self.s["on_request"]
        if not presses:
            return max(time_s - self.s["rest_s"], 0.0)
        begun = max((t for t in self.requests if t <= time_s), default=math.inf)
        after = time_s - begun
        return after if 0.0 < after < presses * 2.0 * math.pi / 2.2 else 0.0

    def depth(self, time_s):
        """Penetration [mm] and its rate [mm/s]."""
        after = self.since_start(time_s)
        moving = float(after > 0.0)
        swing = 0.5 * (self.s["depth_mm"] + self.s["lift_mm"])
        slow, fast = 2.2 * after, 11.0 * after
        depth = -self.s["lift_mm"] + swing * (1.0 - math.cos(slow)) + 0.2 * math.sin(fast)
        return depth, moving * (2.2 * swing * math.sin(slow) + 2.2 * math.cos(fast))

    def turned(self, time_s):
        """The tool's attitude, a quaternion."""
        if self.s["attitudes"]:
            part, fraction = divmod(time_s / 2.0, 1.0)
            known = Rotation.from_quat(self.s["attitudes"])
            here, after = known[int(part) % len(known)], known[(int(part) + 1) % len(known)]
            way = (here.inv() * after).as_rotvec() * max(0.0, fraction - 0.75) / 0.25
            return unit_quaternion((here * Rotation.from_rotvec(way)).as_quat())
        half = 0.5 * math.radians(self.s["rocking_deg"]) * math.sin(self.s["rocking_rate"] * time_s)
        return product(self.attitude, (0.0, math.sin(half), 0.0, math.cos(half)))

    def motor(self, time_s):
        """What the motor of a joint pushes into the tissue [N]: against it, and its own mass."""
        after, swing = self.since_start(time_s), 0.5 * (self.s["depth_mm"] + self.s["lift_mm"])
        moving = float(after > 0.0)
        slow, fast = 2.2**2 * swing * math.cos(2.2 * after), 0.2 * 11.0**2 * math.sin(11.0 * after)
        acceleration = 1e-3 * moving * (slow - fast)
        return self.newtons(time_s) + self.s["position"]["mass"] * acceleration

    def newtons(self, time_s):
        """What the tissue pushes back with."""
        depth, rate = self.depth(time_s)
        return hunt_crossley_force(depth, rate, *self.s["tissue"]) if depth > 0.0 else 0.0

    def wrench(self, time_s):
        """Force and torque as the sensor reads them."""
        newtons = self.newtons(time_s)
        told = self.s["force"]
        sensor = product(self.turned(time_s), self.mounting)
        back = inverse(sensor)
        mass, center = self.s["payload"]["mass"], self.s["payload"]["center"]
        weight = rotated(back, tuple(mass * g for g in GRAVITY))
        push = rotated(back, tuple(told["reaction"] * newtons * n for n in self.normal))
        noisy = [self.random.gauss(0.0, told["noise"]) for _ in range(3)]
        force = tuple(map(sum, zip(push, weight, told["bias"], noisy, strict=True)))
        torque = tuple(
            center[i - 2] * weight[i - 1]
            - center[i - 1] * weight[i - 2]
            + self.random.gauss(0.0, 0.001)
            for i in range(3)
        )
        if told["in_base"]:
            force, torque = rotated(sensor, force), rotated(sensor, torque)
        scale, step = told["scale"], told["step"]
        if step:
            force = tuple(step * round(f / step) for f in force)
        return tuple(scale * f for f in force), tuple(scale * t for t in torque)

    def lifted(self, time_s):
        """How far the surface has moved along its normal [mm]."""
        return self.s["organ"]["breath_mm"] * math.sin(2.0 * math.pi * 0.25 * time_s)

    def organ(self, time_s):
        """Where the surface is [m], and the attitude whose z axis is its normal."""
        lifted = 1e-3 * self.lifted(time_s)
        place = [p + lifted * n for p, n in zip(self.s["surface"], self.normal, strict=True)]
        x, y, z = self.normal
        return place, unit_quaternion((-y, x, 0.0, 1.0 + z))

    def pose(self, time_s):
        """Where the frame of the pose is [m], and its attitude."""
        depth = self.depth(time_s)[0] - self.lifted(time_s)
        turned = self.turned(time_s)
        offset = rotated(turned, tuple(self.s["tip"]))
        noise = 1e-3 * self.s["position"]["noise_mm"]
        place = tuple(
            p - 1e-3 * depth * n - o + self.random.gauss(0.0, noise)
            for p, n, o in zip(self.s["surface"], self.normal, offset, strict=True)
        )
        return place, turned


class Publisher:
    """Publishes a robot's two streams, each when it is due."""

    def __init__(self, node, robot):
        s = robot.s
        qos = QoSProfile(
            depth=100,
            reliability=ReliabilityPolicy.RELIABLE
            if s["reliable"]
            else ReliabilityPolicy.BEST_EFFORT,
        )
        self.robot = robot
        kinds = {"pose": PoseStamped, "transform": TransformStamped, "joint": JointState}
        kind = TFMessage if s["position"]["type"] == "tf" else kinds[s["position"]["type"]]
        self.publishers = {"position": node.create_publisher(kind, s["position"]["topic"], qos)}
        if s["force"]["topic"]:  # else its joints tell their effort
            wrenches = node.create_publisher(WrenchStamped, s["force"]["topic"], qos)
            self.publishers["force"] = wrenches
        if s["organ"]["topic"]:
            self.publishers["organ"] = node.create_publisher(PoseStamped, s["organ"]["topic"], qos)
        if kind is TFMessage:
            self.tell_fixed_frames(node, s["position"])

    def tell_fixed_frames(self, node, told):
        """Tell the flange's place in the moving frame once, as robot_state_publisher does."""
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        self.fixed = node.create_publisher(TFMessage, f"{told['topic']}_static", latched)
        flange = TransformStamped(child_frame_id=told["child"])
        flange.header.frame_id = "wrist"
        flange.transform.translation.z = 0.1
        self.fixed.publish(TFMessage(transforms=[flange]))

    def frames(self, told, place, turned, stamp_ns):
        """Return the tool's pose as a message of /tf: base, shoulder, wrist, (fixed) tool."""
        back = rotated(turned, (0.0, 0.0, 0.1))
        wrist = tuple(p - b for p, b in zip(place, back, strict=True))
        shoulder = TransformStamped(child_frame_id="shoulder")
        shoulder.header.frame_id = told["frame"]
        shoulder.transform.translation.x = 0.3
        moving = TransformStamped(child_frame_id="wrist")
        moving.header.frame_id = "shoulder"
        t, q = moving.transform.translation, moving.transform.rotation
        t.x, t.y, t.z = wrist[0] - 0.3, wrist[1], wrist[2]
        q.x, q.y, q.z, q.w = turned
        other = TransformStamped(child_frame_id="gripper")
        other.header.frame_id = told["child"]
        for transform in (shoulder, moving, other):
            set_stamp(transform.header.stamp, stamp_ns)
        return TFMessage(transforms=[other, shoulder, moving])

    def message(self, stream, time_s, stamp_ns):
        told = self.robot.s[stream]
        time_s -= told["late_s"]
        if stream == "force":
            message = WrenchStamped()
            force, torque = self.robot.wrench(time_s)
            w = message.wrench
            w.force.x, w.force.y, w.force.z = map(float, force)
            w.torque.x, w.torque.y, w.torque.z = map(float, torque)
        elif stream == "organ":
            message = PoseStamped()
            place, turned = self.robot.organ(time_s)
            message.header.frame_id = self.robot.s["position"]["frame"]
            point, q = message.pose.position, message.pose.orientation
            point.x, point.y, point.z = place
            q.x, q.y, q.z, q.w = turned
            set_stamp(message.header.stamp, stamp_ns)
            return message
        elif told["type"] == "joint":
            depth, _rate = self.robot.depth(time_s)
            wander = {
                name: 0.3 * math.sin(0.4 * time_s + i) for i, name in enumerate(told["joints"])
            }
            noisy = depth + told["noise_mm"] * self.robot.random.gauss(0.0, 1.0)
            wander[told["moving"]] = (0.25 + 1e-3 * noisy) * told["unit_per_m"]
            message = JointState(name=list(wander), position=list(map(float, wander.values())))
            if told["effort"]:
                noise = self.robot.s["force"]["noise"]
                efforts = {n: self.robot.random.gauss(0.0, noise) for n in wander}
                efforts[told["moving"]] += told["effort"] * self.robot.motor(time_s)
                message.effort = list(efforts.values())
        else:
            place, turned = self.robot.pose(time_s)
            if told["type"] == "tf":
                return self.frames(told, place, turned, stamp_ns)
            told_as = turned if self.robot.s["tells_attitude"] else (0.0, 0.0, 0.0, 0.0)
            q = dict(zip("xyzw", told_as, strict=True))
            if told["type"] == "pose":
                message = PoseStamped()
                point, attitude = message.pose.position, message.pose.orientation
            else:
                message = TransformStamped(child_frame_id=told["child"])
                point, attitude = message.transform.translation, message.transform.rotation
            point.x, point.y, point.z = map(float, place)
            attitude.x, attitude.y, attitude.z, attitude.w = (q[n] for n in "xyzw")
        message.header.frame_id = told["frame"]
        set_stamp(message.header.stamp, stamp_ns)
        return message

    def run(self, stopped):
        begin_ns = time.time_ns()

        def ask(*_):
            self.robot.requests.append((time.time_ns() - begin_ns) * 1e-9)

        def die(*_):
            self.robot.force_is_dead = True

        signal.signal(signal.SIGUSR1, ask)
        signal.signal(signal.SIGUSR2, die)
        due = []
        counts = dict.fromkeys(self.publishers, 0)
        for stream in counts:
            heapq.heappush(due, (0.0, 0.0, stream))
        while not stopped:
            arrival, time_s, stream = heapq.heappop(due)
            delay = arrival - (time.time_ns() - begin_ns) * 1e-9
            if delay > 0.0:
                time.sleep(delay)
            stamp_ns = begin_ns + round((time_s + self.robot.s["clock_s"]) * 1e9)
            told = self.robot.s[stream]
            silent = time_s > told.get("ends_s", math.inf)
            if not (silent or (stream == "force" and self.robot.force_is_dead)):
                self.publishers[stream].publish(self.message(stream, time_s, stamp_ns))
            counts[stream] += 1
            time_s = counts[stream] / told["rate_hz"]
            late = told["delay_s"] + told["jitter_s"] * self.robot.random.random()
            heapq.heappush(due, (time_s + late, time_s, stream))


def main(path):
    with open(path, encoding="utf-8") as file:
        specification = merged(json.load(file), DEFAULTS)
    stopped = []
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopped.append(True))
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("fake_robot", enable_rosout=False)
    Publisher(node, Robot(specification)).run(stopped)
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(sys.argv[1])
