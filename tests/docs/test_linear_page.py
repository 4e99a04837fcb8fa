"""docs/linear.md: its lines of Python run. Its commands: test_shown.py."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from tests.docs.pages import Page


@pytest.mark.slow
def test_the_lines_of_python_run(tmp_path: Path) -> None:
    page = Page("linear.md")
    page.put(tmp_path)
    names: dict[str, Any] = {}
    for lines in re.findall(r"```python\n(.*?)```", page.text, re.DOTALL):
        text = lines.replace('"hand.ic"', repr(str(tmp_path / "hand.ic")))
        exec("\n".join(line for line in text.splitlines() if "state_space" not in line), names)
    assert "answer" in names
    shake = names["found"].slope.sel(metric="shake", number="more").values
    assert [f"{slope:.1e}" for slope in shake] == ["2.5e-05", "1.3e-05"]
