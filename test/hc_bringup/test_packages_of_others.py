"""Filters and commands from packages outside the tree; hc new filter makes one."""

import errno
import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from hc_bringup.cli import main

pytestmark = pytest.mark.process
Installer = Callable[[Path, str, str], None]
Runner = Callable[..., subprocess.CompletedProcess[str]]


def test_half_a_package_is_not_left_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A disk that was full for a moment: "exists already" was the answer to the next attempt."""
    folder, write, left = tmp_path / "held_ekf_package", Path.write_text, [2]

    def fill(path: Path, text: str, encoding: str) -> int:
        left[0] -= 1
        if left[0] < 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        return write(path, text, encoding=encoding)

    monkeypatch.setattr(Path, "write_text", fill)
    assert main(["new", "filter", "held_ekf", "-o", str(folder)]) == 1
    assert capsys.readouterr().err == f"hc new: cannot write {folder}: No space left on device\n"
    assert not folder.exists()
    monkeypatch.undo()
    assert main(["new", "filter", "held_ekf", "-o", str(folder)]) == 0


def test_a_command_of_another_package_and_one_that_is_broken(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    (tmp_path / "mine.py").write_text(
        'HELP = "say something"\n'
        'def configure(parser):\n    parser.add_argument("--word", default="hello")\n'
        "def run(arguments):\n    print(arguments.word)\n    return 3\n"
    )
    points = "[hc.commands]\nhello = mine\n"
    install(tmp_path, "mine", points)
    done = run(tmp_path, "-m", "hc_bringup", "hello", "--word", "salve")
    assert (done.returncode, done.stdout) == (3, "salve\n"), done.stderr
    assert "say something" in run(tmp_path, "-m", "hc_bringup", "--help").stdout
    install(tmp_path, "broken", "[hc.commands]\nbad = nowhere\n")
    done = run(tmp_path, "-m", "hc_bringup", "bad")
    assert done.returncode != 0
    assert done.stderr.count("\n") == 1
    assert "nowhere" in done.stderr
    assert run(tmp_path, "-m", "hc_bringup", "hello").returncode == 3


def test_a_filter_that_cannot_be_loaded_says_why_and_disturbs_nobody(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    (tmp_path / "recording.csv").write_text("time_s,displacement_mm,force_N\n0,1,2\n")
    (tmp_path / "leaving.py").write_text("import sys\nsys.exit(7)\n")
    points = "bad = nowhere:ENTRY\nukf = os:path\nodd = os:path\ngone = leaving:ENTRY\n"
    install(tmp_path, "a", f"[hc.filters]\n{points}")
    command = ("-m", "hc_bringup", "estimate", "recording.csv", "--filter")
    done = run(tmp_path, *command, "bad")
    assert done.returncode == 2
    assert "filter bad cannot be used: nowhere:ENTRY: ModuleNotFoundError" in done.stderr
    assert "os:path is a module, no FilterEntry" in run(tmp_path, *command, "odd").stderr
    assert "leaving:ENTRY: SystemExit: 7" in run(tmp_path, *command, "gone").stderr
    code = (
        "from hc_estimator.filters.registry import FILTERS, PROBLEMS; print(len(FILTERS), PROBLEMS)"
    )
    done = run(tmp_path, "-c", code)
    assert done.returncode == 0
    assert "'ukf': 'a filter of that name is there already, not os:path'" in done.stdout


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["Filter"], "'Filter' is no name for a package"),
        (["class"], "'class' is no name"),
        (["ukf"], "there is a filter ukf already"),
        (["json"], "there is a Python module json already"),
        (["mine", "-o", "there"], "there exists already"),
    ],
)
def test_a_name_that_does_not_do_is_one_line(tmp_path, monkeypatch, capsys, words, expected):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").mkdir()
    assert main(["new", "filter", *words]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert expected in told


def test_a_new_filter_is_a_whole_package(tmp_path, capsys):
    folder = tmp_path / "held_ekf"
    assert main(["new", "filter", "held_ekf", "-o", str(folder)]) == 0
    assert "hc estimate RECORDING --filter held_ekf" in capsys.readouterr().out
    files = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    assert files == [
        "README.md",
        "held_ekf/__init__.py",
        "held_ekf/entry.py",
        "held_ekf/kernel.py",
        "pyproject.toml",
        "test/test_held_ekf.py",
    ]
    for file in folder.rglob("*.py"):
        text = file.read_text()
        assert "NAME" not in text
        compile(text, str(file), "exec")
    checked = subprocess.run(
        [sys.executable, "-m", "ruff", "check", "--isolated", "--line-length=100", str(folder)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert checked.returncode == 0, checked.stdout


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_new_filter_works_and_its_tests_pass(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    assert main(["new", "filter", "held_ekf", "-o", str(tmp_path / "held_ekf_package")]) == 0
    package = tmp_path / "held_ekf_package"
    install(package, "held_ekf", "[hc.filters]\nheld_ekf = held_ekf.entry:ENTRY\n")
    done = run(package, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test")
    assert "3 passed" in done.stdout, done.stdout[-3000:]
    time_s = np.arange(0.0, 3.0, 0.002)
    depth = 2.0 - 1.5 * np.cos(7.0 * time_s)
    force = 0.5 * depth**1.5 * (1.0 + 0.04 * 10.5 * np.sin(7.0 * time_s))
    rows = "\n".join(f"{t},{d},{f}" for t, d, f in zip(time_s, depth, force, strict=True))
    (package / "presses.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}\n")
    done = run(
        package, "-m", "hc_bringup", "estimate", "presses.csv", "--filter", "held_ekf", "--json"
    )
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert found["filter"] == "held_ekf"
    assert found["parameters"]["stiffness"] == pytest.approx(0.5, rel=0.1)


OWN_MEMORY = '''
"""A filter from outside with a memory, a beginning and a handover of its own; plain Python."""

import dataclasses
import math

import numpy as np

from hc_estimator import estimate as columns
from hc_estimator.filters.registry import FilterEntry
from hc_estimator.memory import Field, record_type
from hc_estimator.screening import CLOCK_FIELDS

FIELDS = (
    Field("clock", record_type(CLOCK_FIELDS)),
    Field("believed", np.float64, (7,)),
    Field("spread", np.float64, (7, 7)),
    Field("count", np.int64),
)


def initialise(settings, memory):
    given = settings[0]
    memory["believed"][0, 3:] = (
        math.log(given["initial_stiffness"]),
        math.log(given["initial_damping"]),
        given["initial_displacement_exponent"],
        given["initial_velocity_exponent"],
    )
    memory["spread"][0] = np.diag([1e-4, 1.0, 1.0, 1.0, 1.0, 0.1, 0.1])


def set_noise(settings, memory):
    memory["spread"][0, 0, 0] = 1e-4


def run(settings, memory, particles, samples, rows):
    """A mean of ln K over the samples, with B, n and p as they were believed to be."""
    for (time, depth, force), row in zip(samples, rows, strict=True):
        m = memory[0]
        usable = math.isfinite(time) and depth > 0.5 and force > 0.0
        if usable:
            m["clock"]["started"] = m["clock"]["accepted"] = 1
            m["clock"]["last_time"] = time
            m["count"] += 1
            seen = math.log(force) - m["believed"][5] * math.log(depth)
            m["believed"][3] += (seen - m["believed"][3]) / m["count"]
            m["spread"][3, 3] = 1.0 / (1.0 + m["count"])
        row[:] = 0.0
        values = m["believed"][3:].copy()
        values[:2] = np.exp(values[:2])
        slopes = np.array([*values[:2], 1.0, 1.0])
        row[columns.PARAMETERS : columns.PARAMETERS + 4] = values
        spread = m["spread"][3:, 3:] * np.outer(slopes, slopes)
        row[columns.COVARIANCE : columns.COVARIANCE + 16] = spread.ravel()
        row[columns.REJECTED] = 0 if usable else 1


def tell(memory):
    return np.array(memory["believed"]), np.array(memory["spread"])


def take(memory, state, covariance):
    memory["believed"], memory["spread"] = state.tolist(), covariance.tolist()
    memory["count"] = 1


ENTRY = FilterEntry(
    run=run,
    specifications=(),
    summary="mean stiffness",
    state_spaces=("kinematic",),
    memory=FIELDS,
    initialise=initialise,
    set_noise=set_noise,
    tell=tell,
    take=take,
)
MUTE = dataclasses.replace(ENTRY, tell=None, take=None)
'''

HANDOVER = """
import json
import os
import numpy as np
from hc_estimator import create_estimator
from hc_estimator.stream.handover import hand_over

def known(estimator):
    answer = estimator.step(float("nan"), 0.0, 0.0)
    return [answer.parameters.tolist(), answer.parameters_std.tolist()]

time_s = np.arange(0.0, 0.3, 0.002)
depth = 2.0 + np.sin(9.0 * time_s)
guess = {"initial_displacement_exponent": 1.5, "initial_velocity_exponent": 1.0}
found = {"first": known(create_estimator("mean_stiffness", **guess))}
source = create_estimator("mean_stiffness", **guess)
source.run(time_s, depth, 0.8 * depth**1.5)
found["mean"] = known(source)
again = create_estimator("mean_stiffness")
again.restore(json.loads(json.dumps(source.state())))
found["restored"] = known(again)
for name in ("ukf", "self_tuning_ukf", "mute"):
    other = hand_over(source, create_estimator(name))
    found[f"to {name}"] = known(other)
    found[f"back from {name}"] = known(hand_over(other, create_estimator("mean_stiffness")))
print(json.dumps(found))
"""


def test_a_filter_with_memory_beginning_and_handover_of_its_own(
    tmp_path: Path, install: Installer
) -> None:
    (tmp_path / "outside.py").write_text(OWN_MEMORY)
    points = "[hc.filters]\nmean_stiffness = outside:ENTRY\nmute = outside:MUTE\n"
    install(tmp_path, "outside", points)
    (tmp_path / "handover.py").write_text(HANDOVER)
    done = subprocess.run(
        [sys.executable, "handover.py"],
        cwd=tmp_path,
        # With the ordinary cache: its settings are those of all, so nothing is compiled anew.
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=110,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    found = {name: np.array(values) for name, values in json.loads(done.stdout).items()}
    np.testing.assert_allclose(found["mean"][0, 0], 0.8, rtol=1e-9)
    np.testing.assert_allclose(found["mean"][0, 1:], found["first"][0, 1:])
    np.testing.assert_array_equal(found["restored"], found["mean"])
    for name in ("ukf", "self_tuning_ukf"):
        np.testing.assert_allclose(found[f"to {name}"], found["mean"], rtol=1e-6)
        np.testing.assert_allclose(found[f"back from {name}"], found["mean"], rtol=1e-6)
    # One that can neither tell nor take gets and gives its means as a first guess.
    np.testing.assert_allclose(found["to mute"][0], found["mean"][0], rtol=1e-9)
    np.testing.assert_allclose(found["back from mute"][0], found["mean"][0], rtol=1e-9)


def test_many_channels_have_the_filters_of_the_suite(
    tmp_path: Path, install: Installer, run: Runner
) -> None:
    """Regression: a KeyError; the node of tactile arrays offered such a filter as well."""
    (tmp_path / "outside.py").write_text(OWN_MEMORY)
    install(tmp_path, "outside", "[hc.filters]\nmean_stiffness = outside:ENTRY\n")
    code = """
import hc_estimator as hc
try:
    hc.EstimatorArray("mean_stiffness", 3)
except ValueError as error:
    print(error)
"""
    done = run(tmp_path, "-c", code)
    assert done.returncode == 0, done.stderr
    assert "filter = 'mean_stiffness' is of another package" in done.stdout
    assert "one of self_tuning_ukf, ukf, ekf" in done.stdout


FAULTY = """
import dataclasses
import numpy as np
from outside import ENTRY, run

def raising(settings, memory, particles, samples, rows):
    run(settings, memory, particles, samples, rows)
    if samples.shape[0] and samples[-1, 0] > 0.2:
        raise ZeroDivisionError("no force")

def without_numbers(settings, memory, particles, samples, rows):
    run(settings, memory, particles, samples, rows)
    rows[:] = np.nan

def too_sure(settings, memory, particles, samples, rows):
    run(settings, memory, particles, samples, rows)
    rows[:, 4] = -1.0

RAISING = dataclasses.replace(ENTRY, run=raising)
WITHOUT_NUMBERS = dataclasses.replace(ENTRY, run=without_numbers)
TOO_SURE = dataclasses.replace(ENTRY, run=too_sure)
"""


def test_a_filter_that_fails_is_named_and_the_suite_is_not_blamed(
    tmp_path: Path, install: Installer
) -> None:
    """Regression of 2026-11-26: "internal error: ZeroDivisionError: ...; please report it"."""
    (tmp_path / "outside.py").write_text(OWN_MEMORY)
    (tmp_path / "faulty.py").write_text(FAULTY)
    names = ("RAISING", "WITHOUT_NUMBERS", "TOO_SURE")
    points = "\n".join(f"{name.lower()} = faulty:{name}" for name in names)
    install(tmp_path, "faulty", f"[hc.filters]\n{points}\n")
    rows = "".join(f"{0.01 * k:.2f},{1 + 0.5 * np.sin(k):.4f},1\n" for k in range(100))
    (tmp_path / "presses.csv").write_text(f"time_s,displacement_mm,force_N\n{rows}")

    path = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))

    def told(*words: str) -> tuple[int, str]:
        done = subprocess.run(
            [sys.executable, "-m", "hc_bringup", *words],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": path},
            capture_output=True,
            text=True,
            timeout=110,
            check=False,
        )
        return done.returncode, done.stderr

    expected = {
        "raising": "filter raising of faulty failed: ZeroDivisionError: no force",
        "without_numbers": "filter without_numbers of faulty gave no code of a rejection",
        "too_sure": "filter too_sure of faulty gave a negative variance",
    }
    for name, line in expected.items():
        status, error = told("estimate", "presses.csv", "--filter", name)
        assert status == 1
        assert line in error.splitlines()[-1]
        assert "ask whoever made the filter" in error
        assert "internal error" not in error
        assert "report it" not in error
        assert "Traceback" not in error
    told("batch", "presses.csv", "-o", "out", "--filter", "raising")
    table = (tmp_path / "out" / "recordings.csv").read_text()
    assert expected["raising"] in table
    assert "report it" not in table
