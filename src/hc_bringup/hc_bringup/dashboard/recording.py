"""A recorder of the dashboard's own: started and stopped from the page."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Any, Final

from hc_bringup.commands.run import file_parameters
from hc_bringup.parameter_file import check_parameter_file
from hc_bringup.plan import NodePlan
from hc_bringup.processes import NodeProcess, describe_exit
from hc_msgs_py.topics import NODE_RECORDER

NODE_NAME: Final = "dashboard_recorder"
STOP_TIMEOUT_S: Final = 5.0


class Recording:
    """Runs a recorder node as a process; belongs to the node's thread."""

    def __init__(self, folder: Path, parameter_file: Callable[[], Path]) -> None:
        """Prepare; nothing is started.

        Args:
            folder: where bags are made.
            parameter_file: finds the recorder's parameter file.
        """
        self._folder, self._parameter_file = folder, parameter_file
        self._process: NodeProcess | None = None
        self._bag: Path | None = None
        self._since = 0.0
        self._failure = ""
        self._output: tempfile.TemporaryDirectory[str] | None = None

    @property
    def status(self) -> dict[str, Any]:
        """What the page shows."""
        self._look()
        if self._process is None:
            return {"on": False, "bag": str(self._bag or ""), "failure": self._failure}
        return {"on": True, "bag": str(self._bag), "seconds": time.monotonic() - self._since}

    def start(self) -> str:
        """Start to record everything into a new bag.

        Raises:
            OSError: if that is not possible; the text says why.
            UserError: if the recorder's parameter file is none.
        """
        self._look()
        if self._process is not None:
            raise OSError(f"recording already into {self._bag}")
        self._folder.mkdir(parents=True, exist_ok=True)
        bag = (self._folder / f"page_{datetime.now():%Y%m%d_%H%M%S}").absolute()
        if bag.exists():
            raise OSError(f"{bag} exists already: wait a second")
        plan = NodePlan(
            NODE_NAME,
            "hc_logger.recorder_node",
            parameters={**_parameters(self._parameter_file()), "output": str(bag)},
        )
        self._output = tempfile.TemporaryDirectory(prefix="hc_dashboard_")
        self._process = NodeProcess(plan, Path(self._output.name))
        self._bag, self._since, self._failure = bag, time.monotonic(), ""
        return f"recording into {bag}"

    def stop(self) -> str:
        """End the recording and return where it is.

        Raises:
            OSError: if nothing is recorded.
        """
        self._look()
        if self._process is None:
            raise OSError(self._failure or "nothing is being recorded")
        status = self._process.stop(STOP_TIMEOUT_S)
        self._forget("" if status == 0 else f"the recorder {describe_exit(status)}")
        if self._failure:
            raise OSError(self._failure)
        return f"recorded: {self._bag}"

    def close(self) -> None:
        """End a recording that is still under way."""
        if self._process is not None:
            self._process.stop(STOP_TIMEOUT_S)
            self._forget("")

    def _look(self) -> None:
        """Take note of a recorder that has died."""
        if self._process is not None and (status := self._process.exit_status()) is not None:
            tail = self._process.tail().splitlines()[-1:]
            self._forget(" ".join([f"the recorder {describe_exit(status)}", *tail]))

    def _forget(self, failure: str) -> None:
        self._process, self._failure = None, failure
        if self._output is not None:
            self._output.cleanup()
            self._output = None


def _parameters(path: Path) -> dict[str, Any]:
    """Return what the recorder's parameter file says: this recorder has another name.

    Raises:
        UserError: if it says nothing of a recorder.
    """
    check_parameter_file(path, NODE_RECORDER)
    return file_parameters(NodePlan(NODE_RECORDER, "", parameter_files=(path,)))
