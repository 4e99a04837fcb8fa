"""The codes of messages, as the page docs/diagnostics.md has them."""

from __future__ import annotations

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "pages" / "diagnostics.md"

_CODE = re.compile(r"^(?:### |\| )([A-Z]\d{3})(?:: | \| )", re.MULTILINE)


def is_on_the_page(code: str) -> bool:
    """Return True if the page has this code; False where it is not installed, too."""
    return PAGE.is_file() and code in _CODE.findall(PAGE.read_text(encoding="utf-8"))
