"""The names of the back ends, each with the mark of what it needs besides Python."""

from __future__ import annotations

import pytest

from met import backends

MARKS = {"c": [pytest.mark.compiler], "wasm": [pytest.mark.node]}
NAMES = [pytest.param(name, marks=MARKS.get(name, [])) for name in backends.HOMES]
