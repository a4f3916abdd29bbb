"""A tissue to press on, a listener to sessions, node processes that always end, and a probe."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest
from geometry_msgs.msg import WrenchStamped
from hc_msgs.msg import IndenterSample
from sensor_msgs.msg import JointState

from hc_estimator import available_filters, create_estimator
from hc_estimator.contact.hunt_crossley import hunt_crossley_force
from hc_msgs_py.conversion import sample_from_message
from hc_msgs_py.node_processes import Caller, end, ros_arguments
from hc_msgs_py.qos import SAMPLE_QOS
from hc_msgs_py.units import set_stamp

TRUE_PARAMETERS = (0.2, 0.008, 1.8, 1.05)  # with which the tissue never pulls


class Plant:
    """Noisy samples of a tool that moves on a tissue of known parameters."""

    def __init__(self, rate_hz=1000.0, seed=1, parameters=TRUE_PARAMETERS):
        self.rate_hz = rate_hz
        self.parameters = parameters
        self._random = np.random.default_rng(seed)

    def motion(self, time_s):
        """Displacement [mm] and velocity [mm/s] of a motion that never leaves the tissue."""
        a, b = 2 * np.pi * 0.7, 2 * np.pi * 2.3
        displacement = 3 + 1.6 * np.sin(a * time_s) + 0.8 * np.sin(b * time_s + 0.5)
        return displacement, 1.6 * a * np.cos(a * time_s) + 0.8 * b * np.cos(b * time_s + 0.5)

    def force(self, displacement, velocity):
        return hunt_crossley_force(displacement, velocity, *self.parameters)

    def readings(self, time_s, offset_mm=0.0):
        """Displacement [mm] and force [N] as the sensors read them at a time."""
        displacement, velocity = self.motion(time_s)
        force = self.force(displacement - offset_mm, velocity)
        return (
            float(displacement - offset_mm + self._random.normal(0, 0.002)),
            float(force + self._random.normal(0, 0.01)),
        )

    def samples(self, count, start=0):
        """(time, displacement, force) of a number of samples."""
        for i in range(start, start + count):
            time_s = i / self.rate_hz
            yield (time_s, *self.readings(time_s))


class Recorder:
    """Listens to a session."""

    def __init__(self):
        self.estimates, self.events, self.contacts, self.revisions = [], [], [], []

    def on_estimate(self, stamp_ns, sequence, force_n, estimate, computation_ns):
        self.estimates.append((stamp_ns, sequence, estimate))

    def on_estimates(self, batch, series, computation_ns):
        for i, estimate in enumerate(series):
            self.estimates.append((int(batch.stamps_ns[i]), int(batch.sequences[i]), estimate))

    def on_event(self, event):
        self.events.append(event)

    def on_contact(self, summary):
        self.contacts.append(summary)

    def on_revision(self, revision):
        self.revisions.append(revision)

    def kinds(self):
        return [event.kind for event in self.events]


@pytest.fixture
def plant():
    return Plant()


@pytest.fixture
def make_plant():
    return Plant


@pytest.fixture
def recorder():
    return Recorder()


@pytest.fixture
def domain_id(ros_domain):
    """A ROS domain of its own for every test."""
    return ros_domain


@pytest.fixture(scope="session")
def compiled():
    """Compile all kernels once, so that no node process keeps a test waiting for it."""
    for name in available_filters():
        create_estimator(name).warm_up()


@pytest.fixture
def start_process(processes, compiled):
    """Start `python -m MODULE` with ROS arguments in the test's domain; killed at the end."""

    def start(module="hc_estimator.node", *arguments, **parameters):
        return processes.start("-m", module, *ros_arguments(parameters, *arguments))

    return start


@pytest.fixture
def start_script(processes):
    """Start one of the scripts beside this file in the test's domain; ended with the test."""

    def start(name, *arguments):
        return processes.start(str(Path(__file__).parent / name), *arguments)

    return start


@pytest.fixture
def end_process():
    return end


class Probe(Caller):
    """The test's own node: publishes samples, listens to everything, calls services."""

    def __init__(self, domain_id):
        os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
        from diagnostic_msgs.msg import DiagnosticArray
        from hc_msgs.msg import (
            ContactSummary,
            EstimatorConfiguration,
            EstimatorEvent,
            HuntCrossleyEstimate,
            IndenterSample,
        )

        from hc_msgs_py import qos, topics

        super().__init__(domain_id, "probe")
        self.estimates, self.events, self.contacts = [], [], []
        self.configurations, self.statuses = [], []
        for kind, topic, profile, take in (
            (HuntCrossleyEstimate, topics.ESTIMATE, qos.ESTIMATE_QOS, self.estimates.append),
            (EstimatorEvent, topics.EVENTS, qos.CONFIGURATION_QOS, self.events.append),
            (ContactSummary, topics.CONTACTS, qos.CONFIGURATION_QOS, self.contacts.append),
            (
                EstimatorConfiguration,
                topics.CONFIGURATION,
                qos.CONFIGURATION_QOS,
                self.configurations.append,
            ),
            (DiagnosticArray, topics.DIAGNOSTICS, qos.DIAGNOSTICS_QOS, self._on_diagnostics),
        ):
            self.node.create_subscription(kind, topic, take, profile)
        self.samples = self.node.create_publisher(IndenterSample, topics.SAMPLE, qos.SAMPLE_QOS)

    def _on_diagnostics(self, message):
        self.statuses += [s for s in message.status if s.name == "estimator"]

    def wait(self, condition, timeout_s=20.0, what="condition"):
        """Spin until a condition holds; fail when it does not in time."""
        assert self.spin_until(condition, timeout_s), f"not within {timeout_s} s: {what}"

    def call(self, name, request_type=None, request=None, timeout_s=90.0):
        """Call a service of the estimator; a Trigger unless told otherwise."""
        from std_srvs.srv import Trigger

        return super().call(
            request_type or Trigger, f"/estimator/{name}", request, timeout_s, answer_s=10.0
        )

    def wait_ready(self):
        """Wait until the estimator says that it has found this node, and this node found it."""
        self.wait(lambda: self.call("ready").success, 90.0, "~/ready")
        self.wait(lambda: self.samples.get_subscription_count() > 0, what="a subscriber")
        self.wait(lambda: self.node.count_publishers("hc/estimate") > 0, what="a publisher")

    def set(self, atomically=False, **parameters):
        """Set parameters; return the answers (one if atomically)."""
        from rcl_interfaces.srv import SetParameters, SetParametersAtomically
        from rclpy.parameter import Parameter

        kind = SetParametersAtomically if atomically else SetParameters
        request = kind.Request()
        request.parameters = [
            Parameter(name.replace("__", "."), value=value).to_parameter_msg()
            for name, value in parameters.items()
        ]
        name = "set_parameters_atomically" if atomically else "set_parameters"
        response = self.call(name, kind, request)
        return response.result if atomically else response.results

    def get(self, *names):
        from rcl_interfaces.srv import GetParameters
        from rclpy.parameter import parameter_value_to_python

        request = GetParameters.Request(names=list(names))
        response = self.call("get_parameters", GetParameters, request)
        return [parameter_value_to_python(value) for value in response.values]

    def publish(self, stamp_ns, sequence, displacement_mm, force_n):
        from hc_msgs_py.conversion import fill_sample, new_sample_message

        message = new_sample_message()
        fill_sample(message, stamp_ns, sequence, displacement_mm, force_n)
        self.samples.publish(message)

    def keep_up(self, wanted, patience_s=5.0):
        """Let the node catch up, so that no queue overflows however slow the machine is."""
        end_s = time.monotonic() + patience_s
        while len(self.estimates) < wanted and time.monotonic() < end_s:
            self.executor.spin_once(timeout_sec=0.01)

    def stream(self, samples, rate_hz=1000.0, first=0, start_ns=None, publish=None, in_step=True):
        """Publish (time, displacement, force) in real time, listening in between.

        With in_step the node may fall behind by a fifth of a second at most: then this waits.
        Returns the number of the next sample.
        """
        publish = publish or self.publish
        begin = time.monotonic()
        start_ns = time.time_ns() if start_ns is None else start_ns
        known = len(self.estimates)
        t0 = None
        number = first
        for number, (time_s, displacement, force) in enumerate(samples, first):
            t0 = time_s if t0 is None else t0
            due = begin + (number - first) / rate_hz
            while (left := due - time.monotonic()) > 0:
                self.executor.spin_once(timeout_sec=left)
            if (number - first) % 50 == 0:
                self.executor.spin_once(timeout_sec=0)
                if in_step:
                    self.keep_up(known + number - first - 200)
            publish(start_ns + round((time_s - t0) * 1e9), number, displacement, force)
        return number + 1

    def kinds(self):
        return [event.kind for event in self.events]


@pytest.fixture
def probe(domain_id):
    probe = Probe(domain_id)
    yield probe
    probe.close()


@pytest.fixture
def arm_and_wrist(start_process, probe):
    """Return what runs an estimator of a joint and a wrench, and gives the samples that it made.

    It takes displacements [mm] and forces [N] by their times since the beginning [ns], how many
    samples to wait for, and settings; it returns the stamp of the beginning beside the samples.
    """

    def run(depth, force, fewest, **settings):
        start_process(
            filter="ekf",
            input__source="sensors",
            input__force__topic="wrist",
            input__position__topic="arm",
            input__position__type="joint",
            **settings,
        )
        got = []
        probe.node.create_subscription(
            IndenterSample,
            "indenter/sample",
            lambda m: got.append(sample_from_message(m)),
            SAMPLE_QOS,
        )
        forces = probe.node.create_publisher(WrenchStamped, "wrist", 1000)
        places = probe.node.create_publisher(JointState, "arm", 1000)
        probe.wait(
            lambda: forces.get_subscription_count() and places.get_subscription_count(), 90.0
        )
        probe.wait(lambda: probe.call("ready").success, 90.0)
        begin = time.time_ns()
        for at in sorted({**depth, **force}):
            if at in force:
                message = WrenchStamped()
                message.wrench.force.z = force[at]
            else:
                message = JointState(name=["tool"], position=[depth[at] / 1000.0])
            set_stamp(message.header.stamp, begin + at)
            (forces if at in force else places).publish(message)
            probe.executor.spin_once(timeout_sec=0.001)
        probe.wait(lambda: len(got) > fewest)
        return begin, got

    return run
