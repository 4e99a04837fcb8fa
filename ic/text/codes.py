"""The codes of messages on the page docs/diagnostics.md."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "pages" / "diagnostics.md"

_CODE = re.compile(r"^(?:### |\| )([A-Z]\d{3})(?:: | \| )", re.MULTILINE)


def is_on_the_page(code: str) -> bool:
    """Return True if the page has this code; False also where it is not installed."""
    return PAGE.is_file() and code in _CODE.findall(PAGE.read_text(encoding="utf-8"))
