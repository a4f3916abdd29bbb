"""The memory of an estimator and its settings, as records that compiled code and Python share.

Everything that an estimator knows between two samples stands in one record, so that saving and
restoring it is copying it. Fields named in `SCRATCH_FIELDS` hold intermediate results within one
sample; they are written before they are read and are no part of the saved state.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

# Whole numbers beyond these are no counts of samples.
SMALLEST_COUNT, LARGEST_COUNT = -(2**53), 2**53
# Beyond this nothing is measured or learnt, and squares would not be finite any more.
LARGEST_NUMBER = 1e150
INDEFINITE = -1e-9  # smallest eigenvalue that rounding may give to a matrix of correlations


class Field(NamedTuple):
    """One field of a record.

    Attributes:
        name: its name.
        kind: float64, int64, or the type of a nested record.
        shape: of an array; () for one value.
        low: smallest value that makes sense; what is restored is checked.
        high: largest such value.
        finite: False if NaN and infinity make sense too.
        covariance: True for a matrix that must be symmetric and positive semidefinite.
    """

    name: str
    kind: Any
    shape: tuple[int, ...] = ()
    low: float | None = None
    high: float | None = None
    finite: bool = True
    covariance: bool = False


# Between samples, besides `screening.CLOCK_FIELDS`.
CORE_FIELDS: tuple[Field, ...] = (
    Field("state", np.float64, (7,)),
    Field("covariance", np.float64, (7, 7), covariance=True),
    Field("prior_variance", np.float64, (4,), 0.0),  # of the parameters, as the state has them
    Field("noise", np.float64, (2,), 0.0),  # variances in use: displacement [mm^2], force [N^2]
    Field("change_detected", np.int64, (), 0, 1),  # at the present sample
    Field("random_counter", np.int64, (), 0),  # numbers drawn so far
    Field("process_noise_scale", np.float64),  # of the adapted part of Q against the settings
)

# Within one sample.
SCRATCH_FIELDS: tuple[Field, ...] = (
    Field("measurement_noise", np.float64, (2,)),  # variances R, tempering included
    Field("process_noise", np.float64, (7, 7)),  # Q
    Field("predicted_state", np.float64, (7,)),
    Field("predicted_covariance", np.float64, (7, 7)),
    Field("updated_state", np.float64, (7,)),
    Field("updated_covariance", np.float64, (7, 7)),
    Field("factor", np.float64, (7, 7)),  # Cholesky factor L of the predicted covariance
    Field("predicted_measurement", np.float64, (2,)),
    Field("sensitivity", np.float64, (7, 2)),  # D with P_xy = L D: measurement per whitened state
    Field("curvature", np.float64, (2, 2)),  # covariance that the nonlinearity of h adds
    Field("innovation", np.float64, (2,)),
    Field("innovation_covariance", np.float64, (2, 2)),  # S
    Field("inverse", np.float64, (2, 2)),  # of S
    Field("nis", np.float64, ()),
    Field("gain", np.float64, (7, 2)),
    Field("half", np.float64, (7, 7)),  # square-root-like part of the updated covariance
    Field("point", np.float64, (7,)),
    Field("images", np.float64, (15, 7)),  # sigma points through the process
    Field("outputs", np.float64, (15, 2)),  # sigma points through the measurement function
    Field("gradient", np.float64, (6,)),
    Field("process_jacobian", np.float64, (7, 7)),
    Field("measurement_jacobian", np.float64, (2, 7)),
    Field("next_noise", np.float64, (2,)),
    Field("next_process_noise_scale", np.float64, ()),
    Field("first_square", np.float64, ()),  # of the innovation of a first pass
    Field("parameters", np.float64, (4,)),
    Field("slopes", np.float64, (4,)),
)


_FIELDS_OF: dict[np.dtype[np.void], tuple[Field, ...]] = {}  # of the types made here


class _Record(np.record):  # type: ignore[misc]  # final in the stubs alone
    """A record whose fields are attributes, whatever they are called (`mean`), as in a kernel."""

    __slots__ = ()

    def __getattribute__(self, name: str) -> Any:
        fields = np.void.__getattribute__(self, "dtype").fields
        if fields is not None and name in fields:
            return np.void.__getitem__(self, name)
        return super().__getattribute__(name)

    def __setattr__(self, name: str, value: Any) -> None:
        fields = np.void.__getattribute__(self, "dtype").fields
        if fields is None or name not in fields:
            raise AttributeError(name)
        np.void.__setitem__(self, name, value)


@functools.cache
def record_type(fields: tuple[Field, ...]) -> np.dtype[np.void]:
    """Structured type of the given fields: one and the same object for the same fields.

    numba looks a type up at each call of a kernel: at once if it is the object that it knows, and
    13 us later, field by field, if it is an equal one.
    """
    description: Any = [(field.name, field.kind, field.shape) for field in fields]
    result: np.dtype[np.void] = np.dtype(description, align=True)
    if numba.config.DISABLE_JIT:  # plain functions ask for fields as attributes
        result = np.dtype((_Record, result))
    _FIELDS_OF[result] = fields
    return result


def fields_of(kind: Any) -> tuple[Field, ...] | None:
    """Fields of a nested record's type; None if it is no record of this package."""
    return _FIELDS_OF.get(kind) if isinstance(kind, np.dtype) else None


def to_plain(record: NDArray[Any], fields: tuple[Field, ...]) -> dict[str, Any]:
    """Plain data (numbers, texts, lists, dicts) of the given fields of one record.

    Survives JSON: what is no number is written as the text that `float` understands.
    """
    return {field.name: _value_to_plain(record[field.name], field) for field in fields}


def _value_to_plain(value: Any, field: Field) -> Any:
    nested = fields_of(field.kind)
    if nested is not None:
        if field.shape:
            flat = np.asarray(value).ravel()
            if any(fields_of(inner.kind) is not None for inner in nested):
                return [to_plain(element, nested) for element in flat]
            # Field by field: hundreds of records one by one take ten times as long.
            columns = [_value_to_plain(flat[inner.name], inner) for inner in nested]
            names = [inner.name for inner in nested]
            return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
        return to_plain(value, nested)
    array = np.asarray(value)
    plain = array.tolist()
    return plain if np.isfinite(array).all() else _without_infinity(plain)


def _without_infinity(value: Any) -> Any:
    if isinstance(value, list):
        return [_without_infinity(element) for element in value]
    return value if math.isfinite(value) else str(value)


def from_plain(plain: Any, fields: tuple[Field, ...], record: NDArray[Any]) -> None:
    """Fill a record from what `to_plain` made of one.

    Args:
        plain: the plain data.
        fields: that are taken.
        record: one record; takes the values.

    Raises:
        ValueError: a field is missing, has another shape, or holds a number that makes no sense.
    """
    if not isinstance(plain, Mapping):
        raise ValueError(f"a record is {type(plain).__name__} instead of names and values")
    for field in fields:
        if field.name not in plain:
            raise ValueError(f"{field.name} is missing")
        _value_from_plain(plain[field.name], field, record)


def _value_from_plain(plain: Any, field: Field, record: NDArray[Any]) -> None:
    nested = fields_of(field.kind)
    if nested is not None:
        if not field.shape:
            from_plain(plain, nested, record[field.name])
            return
        elements = record[field.name].reshape(-1)
        if not isinstance(plain, list) or len(plain) != elements.size:
            raise ValueError(f"{field.name} does not have {elements.size} records")
        for i, element in enumerate(plain):
            from_plain(element, nested, elements[i])
        return
    try:
        given: NDArray[Any] = np.asarray(plain, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{field.name} holds something else than numbers") from None
    if given.shape != field.shape:
        raise ValueError(f"{field.name} has shape {given.shape} instead of {field.shape}")
    _check_range(given, field)
    if field.covariance and not _is_covariance(given):
        raise ValueError(f"{field.name} is no covariance")
    record[field.name] = given


def _check_range(given: NDArray[Any], field: Field) -> None:
    """Raise ValueError if a number makes no sense."""
    whole = field.kind is np.int64
    least, most = (SMALLEST_COUNT, LARGEST_COUNT) if whole else (-LARGEST_NUMBER, LARGEST_NUMBER)
    low = least if field.low is None else field.low
    high = most if field.high is None else field.high
    usual = given[np.isfinite(given)]
    sound = bool((usual >= low).all() and (usual <= high).all())
    if whole:
        sound = sound and bool((usual == np.floor(usual)).all())
    if not sound or ((whole or field.finite) and usual.size < given.size):
        kind = "whole number" if whole else "number"
        raise ValueError(f"{field.name} is not a {kind} from {low:g} to {high:g}")


def _is_covariance(matrix: NDArray[Any]) -> bool:
    """True if a matrix is symmetric and positive semidefinite but for rounding."""
    variances = np.diag(matrix)
    if (variances < 0.0).any():
        return False
    scale = np.sqrt(variances)
    scale[scale == 0.0] = 1e-300  # what has no variance has no covariance either
    with np.errstate(over="ignore"):
        correlation = matrix / scale[:, None] / scale
    if not (np.abs(correlation) < 2.0).all() or np.abs(correlation - correlation.T).max() > 1e-6:
        return False
    return bool(np.linalg.eigvalsh(correlation).min() >= INDEFINITE * len(matrix))
