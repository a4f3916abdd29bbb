"""An estimator's state as its bytes: for who keeps it often and reads it hardly ever.

`Estimator.state()` makes a list of every number, 4 ms for the default filter, and writing those as
JSON takes several more, in which no other thread of the process gets on. Copying the memory and
writing its bytes as text (base64) is no such pause. That text holds for the memory of this version
alone: its layout stands beside it.
"""

from __future__ import annotations

import base64
import binascii
import functools
import hashlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hc_estimator.estimator import MEMORY, Estimator
from hc_estimator.filters.registry import FIELDS, FILTERS
from hc_estimator.memory import record_type, to_plain

_PACKED = "packed"


class FrozenState(NamedTuple):
    """A copy of what an estimator knows at one moment.

    Attributes:
        rest: of `Estimator.state()` what is neither memory nor particles.
        memory: one record, shape (1,).
        particles: what is kept of the particles, float64.
    """

    rest: dict[str, Any]
    memory: NDArray[Any]
    particles: NDArray[np.float64]

    def packed(self) -> dict[str, Any]:
        """Return the state with memory and particles as texts; survives JSON."""
        return {
            **self.rest,
            "memory": {
                _PACKED: base64.b64encode(self.memory.tobytes()).decode(),
                "layout": _layout(self.rest["filter"]),
            },
            "particles": {
                _PACKED: base64.b64encode(self.particles.tobytes()).decode(),
                "shape": list(self.particles.shape),
            },
        }


def freeze(estimator: Estimator) -> FrozenState:
    """Copy the state of an estimator."""
    kept = FILTERS[estimator.filter].kept_particles(estimator._particles)
    return FrozenState(estimator.state_without_memory(), estimator._memory.copy(), kept.copy())


def unpacked(state: Mapping[str, Any]) -> dict[str, Any]:
    """Return the state as `Estimator.state()` gives it; one that is not packed as it is.

    Args:
        state: what `FrozenState.packed` or `Estimator.state` returned, perhaps through JSON.

    Raises:
        ValueError: it is damaged, or packed by another version.
    """
    plain = dict(state)
    packed = plain.get("memory")
    if not isinstance(packed, Mapping) or _PACKED not in packed:
        return plain
    try:
        entry = FILTERS[plain["filter"]]
        fields = FIELDS if entry.memory is None else entry.memory
        kind = _memory_type(plain["filter"])
        if packed["layout"] != _layout(plain["filter"]):
            raise ValueError("its memory is laid out otherwise than that of this version")
        memory = np.frombuffer(_bytes(packed), kind)
        if memory.shape != (1,):
            raise ValueError(f"it holds {len(memory)} memories")
        particles = plain["particles"]
        array = np.frombuffer(_bytes(particles), np.float64).reshape(particles["shape"])
        plain["memory"], plain["particles"] = to_plain(memory[0], fields), array.tolist()
    except (KeyError, TypeError, ValueError, OverflowError) as error:
        raise ValueError(f"cannot unpack a state: {error}") from error
    return plain


def _bytes(packed: Mapping[str, Any]) -> bytes:
    """Return the bytes of a text.

    Raises:
        ValueError: it is no such text.
    """
    try:
        return base64.b64decode(packed[_PACKED], validate=True)
    except binascii.Error as error:
        raise ValueError(f"a text of bytes is damaged: {error}") from error


def _memory_type(filter: str) -> np.dtype[Any]:
    memory = FILTERS[filter].memory
    return MEMORY if memory is None else record_type(memory)


@functools.cache
def _layout(filter: str) -> str:
    """Return what tells a memory from others: a hash of names, types and places of its fields."""
    return hashlib.sha256(repr(_memory_type(filter)).encode()).hexdigest()[:16]
