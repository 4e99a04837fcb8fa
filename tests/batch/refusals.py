"""What is said where something is refused."""

from __future__ import annotations

import pytest

from met.diagnostic import Problem
from met.messages.render import render


def refused(caught: pytest.ExceptionInfo[Problem]) -> str:
    """A message whole, as the user reads it."""
    return render(caught.value.diagnostics)
