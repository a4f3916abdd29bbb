"""Remote and keyboard control of the player: services, parameters, keys, and /clock.

The wheels have no rosbag2_interfaces, so what needs a number is a parameter: `position` (setting
it jumps there), `rate` and `burst_count`. The rest are std_srvs/Trigger services with the names
of rosbag2's player.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock as RclpyClock
from rclpy.clock import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rosgraph_msgs.msg import Clock
from std_srvs.srv import SetBool, Trigger

from hc_logger.keyboard import Keyboard
from hc_logger.playback import Playback
from hc_msgs_py.parameters import declare
from hc_msgs_py.qos import SERVICE_QOS
from hc_msgs_py.units import NANOSECONDS, set_stamp

SMALLEST_RATE = 1e-3
LARGEST_RATE = 1e6
RATE_STEP = 1.1
"""Factor of the keys up and down."""
KEY_WAIT_S = 0.1
CLOCK_DEPTH = 10
SLOWEST_CLOCK_HZ = 1e-3


class PlayerControls:
    """Lets others steer a playback."""

    def __init__(self, node: Node, playback: Playback, tell: Callable[[str], None]) -> None:
        """Offer the services and parameters.

        Args:
            node: the node that offers them; has the parameter `rate` already.
            playback: what they steer.
            tell: called with a line for the user after each key.
        """
        self._playback = playback
        self._tell = tell
        self._stop = threading.Event()
        self._thread: threading.Thread | None = None
        self._burst_count = declare(
            node, "burst_count", 10, "messages that ~/burst plays at once", minimum=1
        )
        declare(
            node,
            "position",
            0.0,
            "set it to jump: seconds of the recording after the start of the playback",
            minimum=0.0,
            unit="s",
        )
        clock_rate = declare(
            node,
            "clock_rate",
            0.0,
            "how often /clock is published, for nodes with use_sim_time; 0 for not at all",
            minimum=0.0,
            maximum=10_000.0,
            unit="Hz",
            read_only=True,
        )
        if 0.0 < clock_rate < SLOWEST_CLOCK_HZ:
            raise ValueError(
                f"parameter clock_rate = {clock_rate:g} is not 0 or from {SLOWEST_CLOCK_HZ:g} Hz"
            )
        keyboard = declare(
            node,
            "keyboard",
            False,
            "space pauses, right plays the next message, up and down change the rate",
            read_only=True,
        )
        node.create_service(SetBool, "~/run", self._run, qos_profile=SERVICE_QOS)
        for name, action in (
            ("pause", self.pause),
            ("resume", self.resume),
            ("toggle_paused", self.toggle_paused),
            ("play_next", self.play_next),
            ("burst", self.burst),
        ):
            node.create_service(Trigger, f"~/{name}", _trigger(action), qos_profile=SERVICE_QOS)
        node.add_on_set_parameters_callback(self._check)
        node.add_post_set_parameters_callback(self._apply)
        if clock_rate > 0.0:
            self._publisher = node.create_publisher(Clock, "/clock", CLOCK_DEPTH)
            self._clock = Clock()
            steady = RclpyClock(clock_type=ClockType.STEADY_TIME)  # not the one it drives
            node.create_timer(1.0 / clock_rate, self._publish_clock, clock=steady)
        if keyboard:
            self._keyboard = Keyboard()
            self._thread = threading.Thread(target=self._read_keys, daemon=True)
            self._thread.start()

    def pause(self) -> str:
        """Pause; returns what to answer."""
        self._playback.pause()
        return f"paused at {self._position():.3f} s"

    def resume(self) -> str:
        """Play, or play on."""
        self._playback.resume()
        return f"plays from {self._position():.3f} s"

    def toggle_paused(self) -> str:
        """Pause or play on."""
        return self.resume() if self._playback.paused else self.pause()

    def play_next(self) -> str:
        """Play one message and stay paused."""
        self._playback.burst(1)
        return f"plays one message after {self._position():.3f} s"

    def burst(self) -> str:
        """Play some messages at once and stay paused."""
        self._playback.burst(self._burst_count)
        return f"plays {self._burst_count} messages after {self._position():.3f} s"

    def change_rate(self, factor: float) -> str:
        """Play faster or slower."""
        rate = min(max(self._playback.rate * factor, SMALLEST_RATE), LARGEST_RATE)
        self._playback.set_rate(rate)
        return f"rate {rate:.3g}"

    def _position(self) -> float:
        return (self._playback.time_ns() - self._playback.first_ns) * 1e-9

    def _run(self, request: Any, response: Any) -> Any:
        """Service ~/run, as all sources of samples have it."""
        response.message = self.resume() if request.data else self.pause()
        response.success = True
        return response

    def _check(self, parameters: list[Parameter]) -> SetParametersResult:
        """Refuse a position after the end of the playback."""
        span = (self._playback.last_ns - self._playback.first_ns) * 1e-9
        for parameter in parameters:
            if parameter.name == "position" and not 0.0 <= parameter.value <= span:
                return SetParametersResult(
                    successful=False,
                    reason=f"position = {parameter.value:g} is outside 0 to {span:.3f} s",
                )
        return SetParametersResult(successful=True)

    def _apply(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "rate":
                self._playback.set_rate(parameter.value)
            elif parameter.name == "position":
                self._playback.seek(self._playback.first_ns + round(parameter.value * NANOSECONDS))
            elif parameter.name == "burst_count":
                self._burst_count = parameter.value

    def _publish_clock(self) -> None:
        set_stamp(self._clock.clock, self._playback.time_ns())
        self._publisher.publish(self._clock)

    def _read_keys(self) -> None:
        """Serve the keyboard; a thread of its own."""
        actions: dict[str, Callable[[], str]] = {
            "space": self.toggle_paused,
            "right": self.play_next,
            "up": lambda: self.change_rate(RATE_STEP),
            "down": lambda: self.change_rate(1.0 / RATE_STEP),
        }
        with self._keyboard:
            while not self._stop.is_set():
                try:
                    names = self._keyboard.read(KEY_WAIT_S)
                except EOFError:
                    return
                for name in names:
                    if name in actions:
                        self._tell(actions[name]())

    def close(self) -> None:
        """Give the terminal back."""
        self._stop.set()
        if self._thread is not None:
            self._thread.join()


def _trigger(action: Callable[[], str]) -> Callable[[Any, Any], Any]:
    def answer(_request: Any, response: Any) -> Any:
        response.message = action()
        response.success = True
        return response

    return answer
