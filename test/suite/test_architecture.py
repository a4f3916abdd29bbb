"""The rule of docs/design.md: imports run one way, and the cores know nothing of ROS."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
# Each package may import those after it.
ORDER = (
    "hc_bringup",
    "hc_evaluation",
    "hc_logger",
    "hc_sim_rig",
    "hc_estimator",
    "hc_msgs_py",
    "hc_msgs",
)
# Generated messages drag the middleware's type support in, so they count as ROS too.
ROS = {
    "rclpy",
    "hc_msgs",
    "builtin_interfaces",
    "std_msgs",
    "std_srvs",
    "geometry_msgs",
    "sensor_msgs",
    "diagnostic_msgs",
    "lifecycle_msgs",
    "rcl_interfaces",
    "rosgraph_msgs",
}
CORES_WITHOUT_ROS = ("hc_estimator", "hc_sim_rig", "hc_evaluation")
LIMIT_LINES = 430


def sources(package: str) -> list[Path]:
    return sorted((ROOT / "src" / package / package).rglob("*.py"))


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported(path: Path) -> Iterator[str]:
    """Top-level packages that a file imports, at its head or inside functions."""
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            yield from (alias.name.split(".")[0] for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module.split(".")[0]


def may_use_ros(path: Path) -> bool:
    return path.name == "node.py" or path.name.endswith("_node.py") or path.parent.name == "ros"


@pytest.mark.parametrize("package", ORDER[:-1])
def test_imports_run_one_way(package: str) -> None:
    allowed = set(ORDER[ORDER.index(package) :])
    files = sources(package)
    assert files
    wrong = {
        f"{path.relative_to(ROOT)} imports {name}"
        for path in files
        for name in imported(path)
        if name in ORDER and name not in allowed
    }
    assert not wrong


@pytest.mark.parametrize("package", CORES_WITHOUT_ROS)
def test_cores_import_no_ros(package: str) -> None:
    wrong = {
        f"{path.relative_to(ROOT)} imports {name}"
        for path in sources(package)
        if not may_use_ros(path)
        for name in imported(path)
        if name in ROS
    }
    assert not wrong


@pytest.mark.parametrize("package", ["hc_estimator", "hc_sim_rig", "hc_logger", "hc_evaluation"])
def test_ros_is_in_the_files_of_nodes_and_in_the_folder_ros(package: str) -> None:
    """One way in all packages: `node.py` and `*_node.py` are nodes, their parts are in ros/."""
    for path in sources(package):
        if path.name.endswith("node.py") and path.parent.name != "ros":
            names = [n.name for n in tree(path).body if hasattr(n, "name")]
            assert "main" in names, f"{path.relative_to(ROOT)} is no node: its place is ros/"
        elif path.parent.name != "ros":
            used = ROS & set(imported(path))
            assert not used, f"{path.relative_to(ROOT)} imports {used}: its place is ros/"


def test_nothing_at_the_bottom_speaks_of_the_estimators_results() -> None:
    """Messages of estimates are made by the estimator, not by a look-alike in hc_msgs_py."""
    likes = [
        f"{path.name}: {node.name}"
        for path in sources("hc_msgs_py")
        for node in tree(path).body
        if isinstance(node, ast.ClassDef) and node.name.endswith("Like")
    ]
    assert not likes


@pytest.mark.process
def test_importing_the_core_does_not_load_rclpy() -> None:
    modules = "hc_estimator hc_sim_rig hc_evaluation hc_logger hc_logger.recording"
    modules += " hc_logger.convert hc_logger.info hc_logger.writer"
    script = (
        "import importlib, sys\n"
        f"for name in '{modules}'.split():\n"
        "    importlib.import_module(name)\n"
        "    if 'rclpy' in sys.modules: sys.exit(f'{name} loads rclpy')"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr


def test_cores_do_not_log_or_print() -> None:
    wrong = {
        f"{path.relative_to(ROOT)} imports logging"
        for package in ("hc_estimator", "hc_sim_rig", "hc_evaluation")
        for path in sources(package)
        if not may_use_ros(path) and "logging" in set(imported(path))
    }
    assert not wrong


@pytest.mark.parametrize("package", ORDER[:-1])
def test_every_file_says_in_its_first_lines_what_it_is(package: str) -> None:
    silent = [
        str(path.relative_to(ROOT))
        for path in sources(package)
        if not ast.get_docstring(tree(path))
    ]
    assert not silent


@pytest.mark.parametrize("package", ORDER[:-1])
def test_no_file_has_grown_out_of_hand(package: str) -> None:
    long = {
        f"{path.relative_to(ROOT)}: {lines} lines"
        for path in sources(package)
        if (lines := len(path.read_text(encoding="utf-8").splitlines())) > LIMIT_LINES
    }
    assert not long


@pytest.mark.parametrize("package", ORDER)
def test_every_package_is_a_ros_package(package: str) -> None:
    folder = ROOT / "src" / package
    assert (folder / "package.xml").is_file()
    if package != "hc_msgs":
        assert (folder / "setup.py").is_file()
        assert (folder / "setup.cfg").is_file()
        assert (folder / "resource" / package).is_file()


def test_lock_file_has_hashes_and_no_addresses() -> None:
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    pinned = [line for line in lines if "==" in line and not line.startswith((" ", "#"))]
    assert len(pinned) > 50
    assert all(line.rstrip().endswith("\\") for line in pinned), "a package without a hash"
    assert not [line for line in lines if "://" in line or "index-url" in line]


def names(path: Path) -> Iterator[str]:
    """Every name that a file gives or uses."""
    for node in ast.walk(tree(path)):
        for field in ("name", "id", "arg", "attr"):
            if isinstance(name := getattr(node, field, None), str):
                yield name


@pytest.mark.parametrize("package", ORDER[:-1])
def test_names_are_the_fields_terms(package: str) -> None:
    """A quantity is estimated, measured or reported; nobody in a program feels or tells."""
    word = re.compile(r"(^|_)(told|felt|newcomers?|veterans?)(_|$)")
    found = {
        f"{p.name}: {name}" for p in sources(package) for name in names(p) if word.search(name)
    }
    assert not found


def test_processes_of_tests_are_started_by_the_one_harness() -> None:
    """`hc_msgs_py.node_processes.Processes` ends what it starts, whatever the test does."""
    this = Path(__file__)
    by_hand = [p for p in (ROOT / "test").rglob("*.py") if ".Popen(" in p.read_text("utf-8")]
    assert [p for p in by_hand if p != this] == []
