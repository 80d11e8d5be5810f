"""What commands say, as JSON for scripts."""

from __future__ import annotations

import json
import math
from typing import Any


def as_json(value: object) -> str:
    """A result as JSON; datasets as their variables with dimensions, units and values, and their attributes."""
    return json.dumps(value, indent=2, default=_plain, allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "data_vars"):
        variables = {
            str(name): {"dims": list(data.dims), "units": data.attrs.get("units", ""), "values": _finite(data.values)}
            for name, data in value.variables.items()
        }
        return {"attributes": dict(value.attrs), "variables": variables}
    return _finite(value) if hasattr(value, "tolist") else str(value)


def _finite(values: Any) -> Any:
    """Numbers of an array as lists; those that JSON does not have are null."""
    plain = values.tolist() if hasattr(values, "tolist") else values
    if isinstance(plain, list):
        return [_finite(value) for value in plain]
    return None if isinstance(plain, float) and not math.isfinite(plain) else plain
