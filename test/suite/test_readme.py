"""Every command that the README and the user's guide show must run, as it stands there.

A fenced block that begins with `sh` holds commands, one a line, in the order in which they are
typed; they run in one fresh folder one after the other. A command that runs until Ctrl-C ends
with `&` there and is ended here when its block is over.

`slow`: all blocks but that of the example bag. They start the same nodes and commands as the tests
of hc_bringup do, once more; what the others here hold them to is that every word is understood.
"""

import os
import re
import shlex
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hc_bringup.cli import command_parser
from hc_msgs_py.node_processes import Processes

ROOT = Path(__file__).resolve().parents[2]
pytestmark = pytest.mark.process
QUICK = "README-1"  # hc estimate bags/example --verify, hc report
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs" / "guide").glob("*.md")))
BLOCKS = [
    pytest.param(
        block,
        id=f"{page.stem}-{number}",
        marks=[] if f"{page.stem}-{number}" == QUICK else [pytest.mark.slow],
    )
    for page in PAGES
    for number, block in enumerate(
        re.findall(r"^```sh\n(.*?)^```", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    )
]
SHARED_DATA = Path(os.environ.get("HC_SHARED_DATA", ROOT.parent / "shared" / "data"))
# Shown to the reader, run by other tests or only once in a while.
NOT_HERE = ("./hc test", "git clone", "cd ", "sudo ", "colcon ", "pip ", "hc bench")


def commands(block: str) -> list[str]:
    joined = block.replace("\\\n", " ")
    lines = [line.split("  #")[0].strip() for line in joined.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


def test_readme_and_guide_have_commands() -> None:
    assert sum(len(commands(str(block.values[0]))) for block in BLOCKS) >= 15
    assert sum(str(block.id).startswith("README") for block in BLOCKS) >= 2


@pytest.mark.parametrize("block", [pytest.param(b.values[0], id=b.id) for b in BLOCKS])
def test_every_word_of_a_command_is_understood(block: str) -> None:
    """As the command line parses it; what a name means it finds out when it runs."""
    for line in commands(block):
        program, *words = shlex.split(line.removesuffix("&"))
        if program in ("./hc", "hc"):
            command_parser(words[0]).parse_args(words[1:])


def wait_until_estimates_flow(environment: dict[str, str]) -> None:
    """Wait as a person does who sees the live display in the other terminal."""
    deadline = time.monotonic() + 120.0
    while time.monotonic() < deadline:
        done = subprocess.run(
            ["hc", "topic", "echo", "hc/estimate", "--once", "--timeout", "2"],
            env=environment,
            capture_output=True,
            timeout=60,
        )
        if done.returncode == 0:
            return
    pytest.fail("no estimate within 120 s of the start")


@pytest.mark.timeout(240)
@pytest.mark.parametrize("block", BLOCKS)
def test_commands_of_readme_run(block: str, tmp_path: Path, ros_domain: int) -> None:
    for name in ("bags", "config"):
        (tmp_path / name).symlink_to(ROOT / name)
    (tmp_path / "shared").mkdir()
    environment = {
        **os.environ,
        "ROS_DOMAIN_ID": str(ros_domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    }
    background = Processes(ros_domain, tmp_path)
    ran = 0
    try:
        for line in commands(block):
            if line.startswith(NOT_HERE) or "hc bench" in line:
                continue
            if "../shared/data" in line and not SHARED_DATA.is_dir():
                pytest.skip(f"needs the recordings in {SHARED_DATA}")
            line = line.replace("../shared/data", str(SHARED_DATA))
            # Three seconds of a run show as much as ten, and of a recording as much as a minute.
            words = shlex.split(line.removesuffix("&").replace("--duration 10", "--duration 3"))
            if words[1] == "replay":
                words += ["--duration", "3"]
            assert words[0] in ("./hc", "hc"), f"do not know how to run {line!r}"
            words[0] = "hc"
            if line.endswith("&"):
                background.launch(words, env=environment, stdout=None, stderr=None)
                wait_until_estimates_flow(environment)
                continue
            done = subprocess.run(
                words, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
            )
            assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
            ran += 1
    finally:
        background.close()
    assert [process.returncode for process in background.started] == [0] * len(background.started)
    if not ran and not background.started:
        pytest.skip("nothing in this block is run here")
