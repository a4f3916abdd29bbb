"""A process that publishes samples, and the same readings as two sensors, at 1 kHz until its end.

A test that answers and asks a lot cannot keep a rate as well. Usage: stream_source.py FIRST_NUMBER
[rest]; with "rest" the tool rests at 0.25 mm and 0.5 N until the process gets SIGUSR1.
"""

import signal
import sys
import time

import numpy as np
import rclpy
from geometry_msgs.msg import PoseStamped, WrenchStamped
from hc_msgs.msg import IndenterSample
from rclpy.signals import SignalHandlerOptions

from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.topics import SAMPLE
from hc_msgs_py.units import set_stamp
from hc_msgs_py.wire import SampleEncoder

RATE_HZ = 1000.0
PARAMETERS = (0.2, 0.008, 1.8, 1.05)


def main(number, rests):
    stopped = []
    moves = [] if rests else [True]
    signal.signal(signal.SIGUSR1, lambda *_: moves.append(True))
    for number_of_signal in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number_of_signal, lambda *_: stopped.append(True))
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node("stream_source", enable_rosout=False)
    samples = node.create_publisher(IndenterSample, SAMPLE, SAMPLE_QOS)
    forces = node.create_publisher(WrenchStamped, "a/wrench", SAMPLE_QOS)
    poses = node.create_publisher(PoseStamped, "a/arm", SAMPLE_QOS)
    encoder, force, pose = SampleEncoder(), WrenchStamped(), PoseStamped()
    generator = np.random.default_rng(number)
    begin = time.monotonic() - number / RATE_HZ
    while not stopped:
        time_s = number / RATE_HZ
        delay = begin + time_s - time.monotonic()
        if delay > 0.0:
            time.sleep(delay)
        displacement = 3.0 + 2.4 * np.sin(4.4 * time_s)
        newton = hunt_crossley_force(displacement, 2.4 * 4.4 * np.cos(4.4 * time_s), *PARAMETERS)
        if not moves:
            displacement, newton = 0.25, 0.5
        displacement += generator.normal(0.0, 0.002)
        newton = float(newton + generator.normal(0.0, 0.01))
        stamp_ns = time.time_ns()
        samples.publish(encoder.encode(stamp_ns, number, displacement, newton))
        set_stamp(force.header.stamp, stamp_ns)
        force.wrench.force.z = newton
        forces.publish(force)
        set_stamp(pose.header.stamp, stamp_ns)
        pose.pose.position.z = displacement / 1000.0
        poses.publish(pose)
        number += 1
    node.destroy_node()
    rclpy.try_shutdown()


if __name__ == "__main__":
    main(int(sys.argv[1]), "rest" in sys.argv[2:])
