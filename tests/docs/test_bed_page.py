"""docs/bed.md: its other steps can be done, and it has every code. Its commands: test_shown.py."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.docs.pages import Page, printed
from tests.docs.test_pages import codes_in_use

PAGE = Page("bed.md")


@pytest.mark.release
def test_its_other_steps_can_be_done(tmp_path: Path) -> None:
    PAGE.put(tmp_path)
    jitter, identify = re.findall(r"^    met (bed .*)$", PAGE.text, re.MULTILINE)[:2]
    printed(tmp_path, jitter)
    printed(tmp_path, identify)
    assert (tmp_path / "shoulder.identified.ic").is_file()


def test_it_has_every_code_of_motor_beds() -> None:
    rows = re.findall(r"^\| (E4.*?) \|", PAGE.text, re.MULTILINE)
    named = set[str]()
    for row in rows:
        codes = re.findall(r"E\d{3}", row)
        named.update(f"E{n}" for n in range(int(codes[0][1:]), int(codes[-1][1:]) + 1))
    assert {code for code in codes_in_use() if code.startswith(("E40", "E41", "E42"))} <= named
