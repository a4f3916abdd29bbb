"""Cholesky factors and eigenvalues of the kernels, against the library."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hc_estimator.linear_algebra import cholesky, eigen


@given(st.integers(1, 7), st.integers(0, 2**31), st.integers(0, 2))
@settings(max_examples=60)
def test_cholesky_of_semidefinite_matrices(size, seed, deficient):
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((size, max(size - deficient, 0)))
    root *= 10.0 ** rng.uniform(-6, 6, (size, 1))
    matrix = root @ root.T
    factor = np.full((size, size), np.nan)
    assert cholesky(matrix, factor)
    scale = np.sqrt(np.diag(matrix)) + 1e-300
    np.testing.assert_allclose(
        factor @ factor.T / scale / scale[:, None], matrix / scale / scale[:, None], atol=1e-6
    )
    assert not np.triu(factor, 1).any()


def test_cholesky_refuses_what_is_not_a_covariance():
    factor = np.empty((2, 2))
    assert not cholesky(np.array([[1.0, 0.0], [0.0, -1.0]]), factor)
    assert not cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]), factor)
    assert not cholesky(np.array([[1.0, 0.0], [0.0, math.nan]]), factor)
    assert not cholesky(np.array([[math.inf, 0.0], [0.0, 1.0]]), factor)


@pytest.mark.parametrize("kind", ["definite", "indefinite", "singular", "diagonal", "far apart"])
def test_eigenvalues_and_vectors_are_the_librarys(kind):
    rng = np.random.default_rng(5)
    for _ in range(100):
        wide = rng.standard_normal((4, 4))
        matrix = wide @ wide.T if kind in ("definite", "singular", "far apart") else wide + wide.T
        if kind == "singular":
            matrix[2] = matrix[:, 2] = 0.0
        if kind == "diagonal":
            matrix = np.diag(np.diag(matrix))
        if kind == "far apart":
            scale = 10.0 ** rng.uniform(-6, 6, 4)
            matrix = matrix * scale * scale[:, None]
        rotated, vectors = matrix.copy(), np.empty((4, 4))
        eigen(rotated, vectors)
        values, scale = np.diag(rotated), np.abs(matrix).max()
        expected = np.linalg.eigvalsh(matrix)
        np.testing.assert_allclose(np.sort(values), expected, rtol=0, atol=1e-14 * scale)
        np.testing.assert_allclose(vectors.T @ vectors, np.eye(4), rtol=0, atol=1e-14)
        back = vectors * values @ vectors.T
        np.testing.assert_allclose(back, matrix, rtol=0, atol=1e-14 * scale)
