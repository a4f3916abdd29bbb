"""Kernels call the C library's mathematics as it is now, with the numbers that Python has."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import llvmlite.binding
import numpy as np
import pytest

from hc_estimator.compilation import compiled
from hc_msgs_py.compilation import inlined

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
