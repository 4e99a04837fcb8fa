"""The engine: compiles plans and runs them. It imports no deck language, no cluster and no serial line."""

from __future__ import annotations

import importlib
from typing import Any

_KEYS = dict.fromkeys(("case_ids", "case_keys", "structure_key"), "met.plan.keys")
_HOMES = {**_KEYS, "Problem": "met.diagnostic"}


def __getattr__(name: str) -> Any:
    """Import a name of this module when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(_HOMES[name]), name)
