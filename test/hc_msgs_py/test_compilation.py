"""Kernels call today's C library, with the numbers that Python has; cached code is checked."""

from __future__ import annotations

import ctypes
import math
from pathlib import Path
from typing import Any

import llvmlite.binding
import numpy as np
import pytest

from hc_estimator.compilation import compiled
from hc_msgs_py.compilation import CheckedCode, inlined

ARGUMENTS = np.concatenate([np.random.default_rng(1).normal(size=2000), [0.0, -1e9, 1e9, 709.7]])


@compiled
def _any_kernel(value: float) -> float:
    """Make numba name its own functions, and the compiler those of the C library after it."""
    return value


@pytest.mark.parametrize("name", ["exp", "log", "pow"])
def test_kernels_are_linked_with_the_functions_of_today(name: str) -> None:
    try:
        library = ctypes.CDLL("libm.so.6")
    except OSError:
        pytest.skip("this C library is not glibc: numba's functions stay")
    address = ctypes.cast(getattr(library, name), ctypes.c_void_p).value
    assert llvmlite.binding.address_of_symbol(name) == address


def test_the_numbers_are_those_of_python() -> None:
    """To the bit: Python calls the same functions, and says of errors what C says by infinity."""

    def values(x: Any, out: Any) -> None:
        for i in range(x.size):
            out[i, 0] = math.exp(x[i])
            out[i, 1] = math.log(abs(x[i]) + 1e-300)

    found = np.empty((ARGUMENTS.size, 2))
    inlined(values)(ARGUMENTS, found)
    assert found[:, 0].tolist() == [math.exp(x) if x < 710.0 else math.inf for x in ARGUMENTS]
    assert found[:, 1].tolist() == [math.log(abs(x) + 1e-300) for x in ARGUMENTS]


def test_code_of_older_sources_is_not_loaded_under_the_new_index(tmp_path: Path) -> None:
    """Regression of 2026-11-29: another process read between a new index and its code."""
    old, new = (CheckedCode(str(tmp_path), "kernel", stamp) for stamp in ("old", "new"))
    old.save("signature", b"old code")
    [code] = tmp_path.glob("*.nbc")
    before = code.read_bytes()
    new.save("signature", b"new code")
    assert new.load("signature") == b"new code"
    code.write_bytes(before)  # as it was until then
    assert new.load("signature") is None
    new.save("signature", b"new code")
    assert new.load("signature") == b"new code"


def test_code_of_another_signature_is_not_loaded(tmp_path: Path) -> None:
    """Two processes that compile two signatures at once give both the first name."""
    first, second = (CheckedCode(str(tmp_path), "kernel", "stamp") for _ in range(2))
    first.save("float", b"of float")
    [code] = tmp_path.glob("*.nbc")
    index = next(tmp_path.glob("*.nbi")).read_bytes()
    code.unlink()
    second.flush()
    second.save("int", b"of int")
    next(tmp_path.glob("*.nbi")).write_bytes(index)
    assert first.load("float") is None


def test_every_kernel_has_a_cache_that_is_checked() -> None:
    _any_kernel(1.0)
    assert isinstance(_any_kernel._cache._cache_file, CheckedCode)
