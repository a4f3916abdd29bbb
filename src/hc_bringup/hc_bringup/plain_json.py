"""JSON that every reader takes: numbers that are not finite become null."""

from __future__ import annotations

import json
import math
from typing import Any


def finite(value: Any) -> Any:
    """Return plain data with every number that is not finite replaced by None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [finite(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def to_compact_json(content: dict[str, Any]) -> str:
    """Return plain data as JSON in one line without spaces."""
    return json.dumps(finite(content), separators=(",", ":"), allow_nan=False)
