"""The binary frames of the page's connection: a header of 24 bytes, then a matrix of float64.

Header, little-endian: kind (1: rows, 2: map, 3: taxels), epoch, number of the first row, rows,
columns, and 1 in an answer to a page that asked for rows; each uint32. What the columns are stands
in the hello message.
"""

from __future__ import annotations

import struct
from typing import Final

import numpy as np
from numpy.typing import NDArray

HEADER: Final = struct.Struct("<6I")
ROWS: Final = 1
MAP: Final = 2
TAXELS: Final = 3


def encode_frame(
    kind: int, epoch: int, first: int, table: NDArray[np.float64], *, answer: bool = False
) -> bytes:
    """Return a frame.

    Args:
        kind: ROWS, MAP or TAXELS.
        epoch: whose rows these are.
        first: number of the first row; of the others the thousandth part of its cell's edge [mm].
        table: (rows, columns).
        answer: whether a page asked for them.
    """
    header = HEADER.pack(kind, epoch, first, table.shape[0], table.shape[1], answer)
    return header + np.ascontiguousarray(table, "<f8").tobytes()
