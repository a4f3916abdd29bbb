"""NUMBA_DISABLE_JIT=1: all filters run as plain Python, for who steps through them."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import hc_estimator as hc

PROGRAM = """
import json, sys
import numpy as np
import hc_estimator as hc
from hc_estimator.multiple_model import sample
name, readings = json.loads(sys.stdin.read())
assert not hasattr(sample.use, "signatures")  # no dispatcher of numba
series = hc.create_estimator(name).run(*(np.array(column) for column in readings))
print(json.dumps([series.parameters.tolist(), series.force_reconstructed.tolist()]))
"""


def contact():
    rng = np.random.default_rng(2)
    time = np.arange(100) / 100.0
    depth = 1.5 + np.sin(6.0 * time)
    force = 0.4 * depth**1.5 * (1.0 + 0.02 * 6.0 * np.cos(6.0 * time))
    noise = rng.standard_normal((2, time.size))
    return time, depth + 0.005 * noise[0], force + 0.01 * noise[1]


@pytest.mark.parametrize("name", hc.available_filters())
def test_a_filter_runs_as_plain_python_and_says_the_same(name):
    """It ended in an AttributeError: a cache of functions that are none, fields of no record."""
    readings = contact()
    given = json.dumps([name, [column.tolist() for column in readings]])
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        input=given,
        capture_output=True,
        text=True,
        timeout=300,
        env=os.environ | {"NUMBA_DISABLE_JIT": "1"},
        check=False,
    )
    assert done.returncode == 0, done.stderr
    parameters, force = json.loads(done.stdout)
    series = hc.create_estimator(name).run(*readings)
    np.testing.assert_allclose(parameters, series.parameters, rtol=1e-6)
    np.testing.assert_allclose(force, series.force_reconstructed, rtol=1e-6)
