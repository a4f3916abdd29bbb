"""Estimates are the same to the bit on every processor.

Regression: tables were made by the library's linear algebra, which sums in an order that depends on
the processor. A bag that was recorded on one machine differed in its sixteenth digit on another,
and `hc estimate --verify` said that its estimates were others.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
from scipy import linalg

import hc_estimator as hc
from hc_estimator.adaptation import motion_density
from hc_estimator.multiple_model import smoothing

PACKAGE = Path(hc.__file__).parent
KERNELS = ("adaptation", "contact", "filters", "multiple_model", "state_space")
NEEDED = {"Nehalem": "sse4_2", "Sandybridge": "avx", "Haswell": "avx2", "SkylakeX": "avx512vl"}
"""What a processor must be able to do for the linear algebra of another one to run on it."""
ESTIMATES = """
import hashlib, sys
import numpy as np
import hc_estimator as hc
rng = np.random.default_rng(0)
time = np.arange(4000) * 0.002
displacement = 3.0 + 1.6 * np.sin(4.4 * time) + 0.8 * np.sin(14.5 * time)
rate = 1.6 * 4.4 * np.cos(4.4 * time) + 0.8 * 14.5 * np.cos(14.5 * time)
force = 0.3 * displacement**1.5 * (1.0 + 0.02 * rate)
displacement += 0.002 * rng.standard_normal(time.size)
force += 0.003 * rng.standard_normal(time.size)
for name in sys.argv[1:]:
    series = hc.create_estimator(name).run(time, displacement, force)
    seen = hashlib.sha256(series.parameters.tobytes() + series.parameters_std.tobytes())
    print(name, seen.hexdigest())
square = rng.standard_normal((200, 200))
print("library", hashlib.sha256((square @ square).tobytes()).hexdigest())
"""


def abilities() -> set[str]:
    """Of this processor."""
    for line in Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines():
        if line.startswith("flags"):
            return set(line.split())
    return set()


def estimates(processor: str) -> str:
    """What filters, and a product of the library, give with the linear algebra of a processor."""
    return subprocess.run(
        [sys.executable, "-c", ESTIMATES, "self_tuning_ukf", "raukf", "ekf"],
        env=os.environ | {"OPENBLAS_CORETYPE": processor},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    ).stdout


def test_estimates_do_not_depend_on_the_processors_linear_algebra() -> None:
    found = [estimates(p) for p, ability in NEEDED.items() if ability in abilities()]
    filters = {said.partition("library")[0] for said in found}
    assert len(filters) == 1
    assert len(filters.pop().split()) == 6
    products = {said.partition("library")[2] for said in found}
    assert len(products) > 1 or len(found) < 3, "the library did not take the processor named"


def test_no_kernel_and_no_table_is_made_by_the_librarys_linear_algebra() -> None:
    used = set()
    for path in sorted(p for name in KERNELS for p in (PACKAGE / name).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            product = isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult)
            named = isinstance(node, ast.Attribute) and node.attr in {"linalg", "dot", "einsum"}
            if product or named:
                used.add(f"{path.relative_to(PACKAGE)}:{node.lineno}")
    assert not used


def test_tables_of_slopes_are_the_librarys() -> None:
    """Least squares over the neighbours; orthonormal polynomials leave the same of any motion."""
    motion = np.random.default_rng(1).standard_normal(2 * smoothing.NEIGHBOURS + 1)
    for m in range(smoothing.FEWEST_NEIGHBOURS, smoothing.NEIGHBOURS + 1):
        count = 2 * m + 1
        powers = np.vander(np.arange(-m, m + 1.0), 6, increasing=True)
        for i, degree in ((smoothing.BY_CUBIC, 3), (smoothing.BY_QUINTIC, 5)):
            expected = np.linalg.pinv(powers[:, : degree + 1])[1]
            np.testing.assert_allclose(smoothing.SLOPES[i, m, :count], expected, atol=1e-13)
        bases, orthonormal = smoothing.QUINTIC_BASES[m, :, :count], np.linalg.qr(powers)[0]
        np.testing.assert_allclose(bases @ bases.T, np.eye(6), atol=1e-13)
        of_motion = (bases @ motion[:count]) ** 2
        np.testing.assert_allclose(of_motion, (orthonormal.T @ motion[:count]) ** 2, atol=1e-13)


def test_the_bank_of_motions_is_the_steady_kalman_filters() -> None:
    transition = np.array([[1.0, 1.0, 0.5], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]])
    noise = np.array([[1 / 20, 1 / 8, 1 / 6], [1 / 8, 1 / 3, 1 / 2], [1 / 6, 1 / 2, 1.0]])
    sensor = np.array([[1.0, 0.0, 0.0]])
    for index, member in zip(motion_density.INDICES, motion_density.BANK, strict=True):
        if index < 1e-10:
            continue  # scipy's own solution is no better known there
        predicted = linalg.solve_discrete_are(transition.T, sensor.T, index * noise, np.eye(1))
        variance = predicted[0, 0] + 1.0
        expected = np.concatenate(([variance], predicted[:, 0] / variance))
        np.testing.assert_allclose(member[:4], expected, rtol=1e-6)
