"""The questions of `hc setup`: which sensors, a rest, some presses; each can be done again."""

from __future__ import annotations

import shutil
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from hc_bringup import heartbeat
from hc_bringup.asking import Asker, yes_or_no
from hc_bringup.errors import FAILURE, UserError
from hc_bringup.graph import Graph
from hc_bringup.plain_stream import drawing_on
from hc_bringup.press_monitor import PressMonitor, resting
from hc_bringup.robot_streams import Recorder, Stream, find_streams, unusable
from hc_bringup.sensor_choice import KINDS, Choice, best
from hc_bringup.wrapping import say

LOOK_S = 1.5
PATIENCE_S = 12.0
"""So long sensors are waited for before somebody is asked whether to go on."""
REST_S = 3.0
PRESS_S = 12.0
FIRST_PRESS_S = 60.0
"""So long the first press is waited for; only then the time of the presses begins."""
FEWEST_PRESSES = 3
LONGEST = 3.0
"""Times the time of the presses that is waited for further ones."""
SILENT_S = 8.0
"""A recording ends when a sensor has sent nothing for so long."""
FINDING = "finding axes, signs, zeros and delay"


class Recorded(NamedTuple):
    """What was recorded: both streams, their readings, until when the tool rested, its turn.

    Attributes:
        force: the force stream.
        position: the position stream.
        readings: of both.
        rest_s: until when the tool rested, on the clock of the readings; None if it was not asked.
        turned_deg: by how much it turned [degree].
        simulated: the sensors are stamped by /clock.
    """

    force: Stream
    position: Stream
    readings: tuple[Any, Any]
    rest_s: float | None
    turned_deg: float
    simulated: bool = False


class GoneSilentError(Exception):
    """A sensor sent nothing any more; says which."""


class BackError(Exception):
    """The user wants to choose the sensors again."""


def at_once(
    graph: Graph, force: str | None, position: str | None, seconds: float, tell: LiveLine
) -> Recorded:
    """Record what is proposed while the tool presses, and ask nothing.

    Raises:
        UserError: if there are no such sensors, or they send nothing.
    """
    chosen = look(graph).proposed(force, position)
    with Recorder(graph, *chosen) as recorder:
        names = " and ".join(dict.fromkeys(stream.name for stream in chosen))
        say(
            f"recording {names} for {seconds:g} s: press into the tissue and leave it again, "
            "several times"
        )
        recorder.start()
        recorder.spin(seconds, lambda left: tell(f"recording presses: {left:3.0f} s"))
        tell.clear()
        say("recorded; finding axes, signs, zeros and delay ...")
        heartbeat.doing(FINDING)
        if recorder.silent():
            raise UserError(f"{recorder.silent()}: is its driver still running?", FAILURE)
        return _recorded(recorder, chosen[0], chosen[1], None)


def _recorded(
    recorder: Recorder, force: Stream, position: Stream, rest_s: float | None
) -> Recorded:
    """Return what a recorder of two streams holds."""
    return Recorded(
        force,
        position,
        recorder.readings(),
        rest_s,
        recorder.turned_deg,
        recorder.follows_clock,
    )


def look(graph: Graph) -> Choice:
    """Look for sensors and say which there are."""
    say(f"looking for sensors (at most {PATIENCE_S:g} s) ...")
    heartbeat.doing("looking for sensors")
    streams = find_streams(graph, LOOK_S, PATIENCE_S)
    heartbeat.nothing()
    for stream in streams:
        alive = f"{stream.rate_hz:.0f} Hz" if stream.rate_hz > 0.0 else "no message"
        say(f"  {stream.name} ({stream.kind}): {alive}")
    others = unusable(graph)
    if not all(best(streams, kinds) for kinds in KINDS.values()):
        for name, why in others.items():
            say(f"  {name} {why}")
    return Choice(streams, others)


class LiveLine:
    """A line on the terminal that is written over again and again; elsewhere one now and then."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()

    def __call__(self, text: str) -> None:
        """Show a text instead of the present one; what is wider than the terminal is cut off."""
        if self._shown:
            width = shutil.get_terminal_size().columns - 1  # a line that wraps cannot be undone
            print(f"\r\x1b[K{text[:width]}", end="", file=drawing_on(sys.stderr), flush=True)
        else:
            heartbeat.telling("live line", text)

    def clear(self) -> None:
        """Leave an empty line."""
        if self._shown:
            print("\r\x1b[K", end="", file=drawing_on(sys.stderr), flush=True)
        else:
            heartbeat.nothing()


class Guide:
    """Asks for what is needed, step by step."""

    def __init__(
        self,
        graph: Graph,
        asker: Asker,
        tell: LiveLine,
        seconds: float,
        scales: tuple[float, float] = (1.0, 1.0),
    ) -> None:
        """Begin.

        Args:
            graph: where the sensors are.
            asker: who is asked.
            tell: where the live line goes.
            seconds: of presses.
            scales: N and m that one of the readings of force and position stands for.
        """
        self._graph = graph
        self._scales = scales
        self._asker = asker
        self._tell = tell
        self._seconds = seconds

    def choose(self, force: str | None, position: str | None) -> tuple[Stream, Stream]:
        """Let the user choose both sensors; look again as often as wished.

        Raises:
            UserError: if the user does not want to look again.
        """
        while True:
            choice = look(self._graph)
            streams = choice.streams
            try:
                # Both are there before anything is asked.
                proposed = choice.proposed(force, position)
            except UserError as error:
                say(str(error))
                if not yes_or_no(self._asker, "look again?"):
                    raise
                continue
            pushes, place = proposed
            if force is None:
                pushes = self._pick(streams, pushes, "force")
            if pushes.kind == "effort":
                return pushes, pushes._replace(kind="joint")
            if position is None:
                place = self._pick(streams, choice.given(None, "position", pushes), "position")
            return pushes, place

    def _pick(self, streams: list[Stream], proposed: Stream, what: str) -> Stream:
        alive = [s for s in streams if s.kind in KINDS[what] and s.rate_hz > 0.0]
        if len(alive) == 1:
            say(f"{what}: {proposed.name}")
            return proposed
        answers = {"": "0"}
        for i, stream in enumerate(alive, 1):
            say(f"  {i}. {stream.name} ({stream.kind})")
            answers[str(i)] = str(i)
        number = self._asker.choose(
            f"number of the {what} topic [Enter: {proposed.name}]", answers, self._wait
        )
        return alive[int(number) - 1] if number != "0" else proposed

    def _wait(self, seconds: float) -> None:
        if not self._graph.spin(seconds):
            raise KeyboardInterrupt

    def record(self, force: Stream, position: Stream) -> Recorded:
        """Let the tool rest, then press; again and again until something was felt.

        Raises:
            BackError: if other sensors are wanted.
            UserError: if the user ends it.
        """
        while True:
            with Recorder(self._graph, force, position) as recorder:
                try:
                    rest_s = self._rest(recorder)
                    monitor = self._presses(recorder)
                except GoneSilentError as error:
                    self._tell.clear()
                    self.again(f"{error}: is its driver still running?", recorder.idle)
                    continue
                if monitor.has_pressed:
                    say(f"felt: {monitor.sentence}")
                    return _recorded(recorder, force, position, rest_s)
                self.again(
                    f"no press was felt: {monitor.sentence}. Does the tool touch the tissue, and "
                    f"is {force.topic} its sensor?",
                    recorder.idle,
                )

    def again(self, why: str, meanwhile: Callable[[float], None] | None = None) -> None:
        """Say what went wrong and return if the user wants to press again.

        Raises:
            BackError: if other sensors are wanted.
            UserError: if the user ends it.
        """
        say(why)
        answers = {"": "", "r": "", "b": "b", "q": "q"}
        answer = self._asker.choose(
            "press again [Enter], choose other sensors [b], or end [q]?",
            answers,
            meanwhile or self._wait,
        )
        if answer == "b":
            raise BackError
        if answer == "q":
            raise UserError("ended: nothing was written", FAILURE)

    def accepts(self, question: str) -> bool:
        """Ask whether what was found is right; False: press again.

        Raises:
            BackError: if other sensors are wanted.
            UserError: if the user ends it.
        """
        answers = {"": "y", "y": "y", "yes": "y", "r": "r", "b": "b", "q": "q"}
        answer = self._asker.choose(
            f"{question} [Enter], press again [r], choose other sensors [b], or end [q]?",
            answers,
            self._wait,
        )
        if answer == "b":
            raise BackError
        if answer == "q":
            raise UserError("ended: nothing was written", FAILURE)
        return answer == "y"

    def _rest(self, recorder: Recorder) -> float:
        """Let the tool rest; returns until when it did, on the clock of the readings."""
        while True:
            self._asker.ask(
                "Bring the tool to rest free of contact, near the tissue; then press Enter.",
                recorder.idle,
            )
            recorder.start()
            self._spin(recorder, REST_S, lambda left: f"let it rest: {left:3.0f} s")
            self._tell.clear()
            doubt = resting(recorder, self._scales)
            if not doubt:
                return recorder.elapsed_s
            say(f"{doubt}: was it at rest, and in the air?")
            answers = {"": "", "r": "", "g": "g"}
            if self._asker.choose("rest again [Enter], or go on all the same [g]?", answers) == "g":
                return recorder.elapsed_s

    def _presses(self, recorder: Recorder) -> PressMonitor:
        """Let the tool press; the time runs from the first press that is felt."""
        monitor = PressMonitor(recorder, self._scales)
        say(
            "Now press into the tissue and leave it again, several times, slow and fast "
            f"({self._seconds:g} s from the first press on)."
        )
        began = time.monotonic()
        first: float | None = None
        while True:
            now = time.monotonic()
            if first is None:
                left = FIRST_PRESS_S - (now - began)
                if left <= 0.0:
                    break
                line = f"waiting for the first press ({left:.0f} s): {monitor.sentence}"
            else:
                left = self._seconds - (now - first)
                enough = monitor.presses >= FEWEST_PRESSES
                if left <= 0.0 and (enough or now - first > LONGEST * self._seconds):
                    break
                wanted = f"{left:3.0f} s" if left > 0.0 else "leave the tissue and press again"
                line = f"press: {wanted}; {monitor.sentence}"
            self._spin(recorder, 0.25, lambda _left, line=line: line)  # type: ignore[misc]
            monitor.update()
            if first is None and monitor.has_pressed:
                first = time.monotonic()
        self._tell.clear()
        return monitor

    def _spin(self, recorder: Recorder, seconds: float, line: Callable[[float], str]) -> None:
        """Record for a while with a live line.

        Raises:
            GoneSilentError: if a sensor has sent nothing for long.
        """

        def tell(left: float) -> None:
            silent = recorder.silent()
            self._tell(silent or line(left))
            if recorder.silent(SILENT_S):
                raise GoneSilentError(silent)

        recorder.spin(seconds, tell)
