"""Build backend that compiles the messages against the ROS wheels (PEP 517).

ament and CMake look for packages under AMENT_PREFIX_PATH and CMAKE_PREFIX_PATH, which a
ROS installation sets and wheels do not; this shim sets them and hands over to
scikit-build-core. A colcon workspace does not use it.

An editable install (`pip install -e .`) compiles the messages and puts the source folders
of the Python packages on the path, so that an edit is live at the next start.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

from scikit_build_core import build as _scikit_build_core

HERE = Path(__file__).resolve().parent


def _prepare(source_folders: list[Path]) -> None:
    """Point CMake at the prefix that holds the ROS wheels (the build environment's)."""
    import rosidl_cmake  # a marker module that every install of the build wheels has

    site_packages = Path(rosidl_cmake.__file__).resolve().parents[1]
    prefix = site_packages.parents[2]
    python_folder = f"lib/python{sysconfig.get_python_version()}/site-packages"
    os.environ["AMENT_PREFIX_PATH"] = str(prefix)
    os.environ["CMAKE_PREFIX_PATH"] = str(prefix)
    os.environ["PYTHONHASHSEED"] = "0"  # the generators write what they keep in sets
    os.environ.setdefault("CMAKE_BUILD_PARALLEL_LEVEL", str(os.cpu_count() or 1))
    arguments = [
        f"-DCMAKE_PROJECT_hc_msgs_INCLUDE={HERE / 'wheels_fix.cmake'}",
        "-DHC_FROM_WHEELS=ON",
        f"-DPYTHON_INSTALL_DIR={python_folder}",
        "-DBUILD_TESTING=OFF",
    ]
    if source_folders:
        arguments.append("-DHC_SOURCE_FOLDERS=" + ";".join(str(f) for f in source_folders))
    elif commit := _commit():  # an editable install asks git itself
        arguments.append(f"-DHC_COMMIT={commit}")
    os.environ["CMAKE_ARGS"] = " ".join(
        [os.environ.get("CMAKE_ARGS", ""), *(shlex.quote(a) for a in arguments)]
    ).strip()


def _commit() -> str:
    """The commit of this checkout, or nothing where it is none."""
    return _git("describe", "--always", "--exclude=*", "--abbrev=7", "--dirty=, changed")


def _git(*words: str) -> str:
    """What git says of this checkout, or nothing where it is none."""
    if not (HERE.parents[1] / ".git").exists():
        return ""
    try:
        return subprocess.run(
            ["git", "-C", str(HERE), *words], capture_output=True, text=True, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def build_wheel(
    wheel_directory: str,
    config_settings: dict[str, Any] | None = None,
    metadata_directory: str | None = None,
) -> str:
    """Build the wheel with the compiled messages and all Python packages."""
    # The same sources give the same wheel, to the byte: files are as old as the commit (zip knows
    # nothing before 1980), and no path of this machine is compiled in (wheels_fix.cmake).
    os.environ.setdefault("SOURCE_DATE_EPOCH", _git("log", "-1", "--format=%ct") or "315532800")
    _prepare([])
    return _scikit_build_core.build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(
    wheel_directory: str,
    config_settings: dict[str, Any] | None = None,
    metadata_directory: str | None = None,
) -> str:
    """Build a wheel with the compiled messages and a path file naming the source folders."""
    folders = sorted(
        folder
        for folder in HERE.parent.iterdir()
        if folder != HERE and (folder / "package.xml").is_file()
    )
    _prepare(folders)
    settings = {**(config_settings or {}), "wheel.packages": ""}
    return _scikit_build_core.build_wheel(wheel_directory, settings, metadata_directory)


def build_sdist(sdist_directory: str, config_settings: dict[str, Any] | None = None) -> str:
    """Build the source distribution."""
    return _scikit_build_core.build_sdist(sdist_directory, config_settings)
