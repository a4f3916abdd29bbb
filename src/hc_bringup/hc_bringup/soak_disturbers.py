"""What disturbs a soak: parameters that change at random, and viewers that come, stall and die."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

import rclpy
from rcl_interfaces.srv import GetParameters, SetParametersAtomically
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.qos import qos_profile_parameters
from rclpy.signals import SignalHandlerOptions

from hc_estimator import available_filters, available_state_spaces
from hc_msgs_py.topics import NODE_ESTIMATOR

RECONFIGURATIONS_PER_S = 20.0
RESTORE_AGAIN_S = 2.0
"""A node that is killed meanwhile does not answer."""
VIEWERS: tuple[tuple[str, ...], ...] = (
    ("topic", "echo", "hc/estimate", "--csv"),
    ("topic", "hz", "hc/estimate"),
    ("topic", "echo", "indenter/sample", "--csv"),
    ("param", "dump", NODE_ESTIMATOR),
)
VIEWER_PERIOD_S = 6.0
VIEWER_LIFE_S = 4.0
_ENDINGS = (signal.SIGTERM, signal.SIGKILL, signal.SIGSTOP)
"""One that is stopped stands still until the next one comes, and is killed then."""

_Draws = Mapping[str, Callable[[random.Random], Any]]
DRAWS: _Draws = {
    "filter": lambda g: g.choice(available_filters()),
    "state_space": lambda g: g.choice(available_state_spaces()),
    "carry_over": lambda g: g.random() < 0.8,
    "outlier_gate": lambda g: g.uniform(2.0, 40.0),  # 3 and more are allowed
    "force_noise_std": lambda g: 10.0 ** g.uniform(-3.0, 0.0),
    "displacement_noise_std": lambda g: 10.0 ** g.uniform(-4.0, -1.0),
    "displacement_exponent_walk": lambda g: 10.0 ** g.uniform(-9.0, -3.0),
    "velocity_exponent_walk": lambda g: 10.0 ** g.uniform(-9.0, -3.0),
    "force_limit": lambda g: g.uniform(500.0, 1500.0),
    "input.silence_timeout": lambda g: g.uniform(0.005, 2.0),  # 0.01 and more
    "contact.minimum_duration": lambda g: g.uniform(-0.02, 0.2),  # 0 and more
}


def random_settings(generator: random.Random) -> dict[str, Any]:
    """Draw one to three settings of the estimator node, now and then out of range."""
    names = generator.sample(sorted(DRAWS), generator.randint(1, 3))
    return {name: DRAWS[name](generator) for name in names}


class ParameterStorm:
    """Sets random parameters of the estimator from a thread of its own, while active.

    Attributes:
        active: whether to go on setting; when it becomes false, the settings that the node had at
            first are set again.
        asked: changes asked for.
        taken: changes that the node took.
        refused: changes that it refused.
    """

    def __init__(self, seed: int) -> None:
        self.active = False
        self.asked = self.taken = self.refused = 0
        self._generator = random.Random(seed)
        self._first: dict[str, Any] = {}
        self._restored_at: float | None = None
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="soak_parameters")

    @property
    def settled_s(self) -> float:
        """For how long the node has said that it has its first settings again; 0: it has not."""
        restored_at = self._restored_at
        return 0.0 if self.active or restored_at is None else time.monotonic() - restored_at

    def __enter__(self) -> ParameterStorm:
        self._thread.start()
        return self

    def __exit__(self, *_exception: object) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        context = rclpy.Context()
        rclpy.init(args=[], context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = rclpy.create_node("hc_soak", context=context, enable_rosout=False)
        executor = SingleThreadedExecutor(context=context)
        executor.add_node(node)
        change = node.create_client(
            SetParametersAtomically,
            f"/{NODE_ESTIMATOR}/set_parameters_atomically",
            # Of a service's usual queue of ten, answers that come at once after a wait are lost.
            qos_profile=qos_profile_parameters,
        )
        look = node.create_client(GetParameters, f"/{NODE_ESTIMATOR}/get_parameters")
        due, restore_at = time.monotonic(), 0.0
        while not self._stop.is_set():
            due = max(due + 1.0 / RECONFIGURATIONS_PER_S, time.monotonic())
            if change.service_is_ready() and look.service_is_ready():
                if not self._first:
                    look.call_async(GetParameters.Request(names=list(DRAWS))).add_done_callback(
                        self._remember
                    )
                elif self.active:
                    self._ask(change, random_settings(self._generator), self._hear)
                    self._restored_at, restore_at = None, 0.0
                elif self._restored_at is None and time.monotonic() >= restore_at:
                    self._ask(change, self._first, self._hear_restored)
                    restore_at = time.monotonic() + RESTORE_AGAIN_S
            while (left := due - time.monotonic()) > 0.0:
                executor.spin_once(timeout_sec=left)
        executor.shutdown()
        node.destroy_node()
        context.try_shutdown()

    def _remember(self, future: Any) -> None:
        values = map(parameter_value_to_python, future.result().values)
        self._first = dict(zip(DRAWS, values, strict=True))

    def _ask(self, client: Any, settings: Mapping[str, Any], hear: Callable[[Any], None]) -> None:
        request = SetParametersAtomically.Request(
            parameters=[Parameter(n, value=v).to_parameter_msg() for n, v in settings.items()]
        )
        self.asked += 1
        client.call_async(request).add_done_callback(hear)

    def _hear(self, future: Any) -> None:
        if future.result().result.successful:
            self.taken += 1
        else:
            self.refused += 1

    def _hear_restored(self, future: Any) -> None:
        self._hear(future)
        if future.result().result.successful and not self.active:
            self._restored_at = time.monotonic()


class Viewers:
    """Starts command lines that look at the run, and ends each roughly, one after another.

    Attributes:
        count: how many there were.
    """

    def __init__(self, seed: int) -> None:
        self.count = 0
        self._generator = random.Random(seed)
        self._viewer: subprocess.Popen[bytes] | None = None
        self._next_s = VIEWER_PERIOD_S
        self._end_s = 0.0

    def __enter__(self) -> Viewers:
        return self

    def __exit__(self, *_exception: object) -> None:
        self._kill()

    def look(self, elapsed_s: float) -> None:
        """Start or end one if it is time to; call it often."""
        if self._viewer is not None and self._end_s and elapsed_s >= self._end_s:
            self._viewer.send_signal(self._generator.choice(_ENDINGS))
            self._end_s = 0.0
        if elapsed_s >= self._next_s:
            self._kill()
            self._next_s = elapsed_s + VIEWER_PERIOD_S
            self._end_s = elapsed_s + VIEWER_LIFE_S
            words = self._generator.choice(VIEWERS)
            self._viewer = subprocess.Popen(
                [sys.executable, "-m", "hc_bringup", *words],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=os.environ,
            )
            self.count += 1

    def _kill(self) -> None:
        if self._viewer is not None:
            self._viewer.kill()
            self._viewer.wait()
            self._viewer = None
