"""Trees of numbers for JSON."""

from __future__ import annotations

import math
from typing import Any


def plain(value: Any) -> Any:
    """`value` without NaN and infinity (both null) and without tuples."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inner) for inner in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
