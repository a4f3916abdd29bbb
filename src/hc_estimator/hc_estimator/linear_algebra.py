"""Small dense linear algebra for the kernels, on preallocated arrays.

The same to the bit on every processor. Libraries choose the order of their sums by the processor,
and of two machines each would compute the estimates of the other a little differently.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from hc_estimator.compilation import compiled

# A pivot this much smaller than its diagonal element is rounding error, not information.
PIVOT_TOLERANCE = 1e-15
MOST_SWEEPS = 20  # of rotations over a matrix; from any matrix five or six are enough
ROUNDING = 1e-16  # of the diagonal, up to which what is beside it is zero


# Plain loops instead of slice assignments: numba's own drag in its string formatting for the errors
# that they might raise, seconds of compilation for nothing.


@compiled
def clear_vector(target: NDArray[np.float64]) -> None:
    """Set all elements of a vector to zero."""
    for i in range(target.shape[0]):
        target[i] = 0.0


@compiled
def clear_matrix(target: NDArray[np.float64]) -> None:
    """Set all elements of a matrix to zero."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = 0.0


@compiled
def copy_vector(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy a vector onto another of the same length."""
    for i in range(target.shape[0]):
        target[i] = source[i]


@compiled
def copy_matrix(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy a matrix onto another of the same shape."""
    for i in range(target.shape[0]):
        for j in range(target.shape[1]):
            target[i, j] = source[i, j]


@compiled
def cholesky(matrix: NDArray[np.float64], factor: NDArray[np.float64]) -> bool:
    """Lower Cholesky factor of a symmetric positive semidefinite matrix.

    A pivot that is zero to rounding error makes a zero column: a parameter that is held fixed has
    zero variance, and its sigma points then coincide.

    Args:
        matrix: symmetric matrix, shape (n, n); only the lower triangle is read.
        factor: takes the factor L with L L^T = matrix, shape (n, n).

    Returns:
        False if the matrix is not finite or clearly indefinite; the factor is then unusable.
    """
    return leading_cholesky(matrix, factor, matrix.shape[0])


@compiled
def is_definite(factor: NDArray[np.float64], n: int) -> bool:
    """True if no pivot of a leading factor was zero: L L^T x = b has then one solution."""
    least = math.inf
    for i in range(n):
        least = min(least, factor[i, i])
    return least > 0.0


@compiled
def leading_cholesky(matrix: NDArray[np.float64], factor: NDArray[np.float64], n: int) -> bool:
    """Factor the leading n rows and columns of a matrix, which may be `factor`; see `cholesky`."""
    for j in range(n):
        pivot = matrix[j, j]
        for k in range(j):
            pivot -= factor[j, k] * factor[j, k]
        threshold = PIVOT_TOLERANCE * matrix[j, j]
        if not (pivot >= -1e4 * threshold and pivot < math.inf):  # NaN fails too
            return False
        if pivot <= threshold:
            for i in range(j, n):
                factor[i, j] = 0.0
        else:
            root = math.sqrt(pivot)
            factor[j, j] = root
            for i in range(j + 1, n):
                total = matrix[i, j]
                for k in range(j):
                    total -= factor[i, k] * factor[j, k]
                factor[i, j] = total / root
        for i in range(j):
            factor[i, j] = 0.0
    return True


@compiled
def eigen(matrix: NDArray[np.float64], vectors: NDArray[np.float64]) -> None:
    """Eigenvalues and eigenvectors of a small symmetric matrix, by Jacobi's rotations.

    (Golub and Van Loan, Matrix Computations, 2013, 8.5.)

    Args:
        matrix: finite, shape (n, n); its diagonal takes the eigenvalues, in no order.
        vectors: its columns take the eigenvectors, shape (n, n).
    """
    n = matrix.shape[0]
    for i in range(n):
        for j in range(n):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(MOST_SWEEPS):
        rotations = 0
        for i in range(n - 1):
            for j in range(i + 1, n):
                beside = matrix[i, j]
                if abs(beside) > ROUNDING * math.sqrt(abs(matrix[i, i] * matrix[j, j])):
                    _rotate(matrix, vectors, i, j)
                    rotations += 1
        if rotations == 0:
            return


@compiled
def _rotate(matrix: NDArray[np.float64], vectors: NDArray[np.float64], i: int, j: int) -> None:
    """Rotate so that element i, j becomes zero."""
    beside = matrix[i, j]
    ratio = (matrix[j, j] - matrix[i, i]) / (2.0 * beside)
    tangent = 1.0 / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
    if ratio < 0.0:
        tangent = -tangent
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    matrix[i, i] -= tangent * beside
    matrix[j, j] += tangent * beside
    matrix[i, j] = matrix[j, i] = 0.0
    for k in range(matrix.shape[0]):
        if k not in (i, j):
            first, second = matrix[k, i], matrix[k, j]
            matrix[k, i] = matrix[i, k] = cosine * first - sine * second
            matrix[k, j] = matrix[j, k] = sine * first + cosine * second
        first, second = vectors[k, i], vectors[k, j]
        vectors[k, i] = cosine * first - sine * second
        vectors[k, j] = sine * first + cosine * second
