"""The page on how true the numbers are shows what a run rests on as it is printed."""

from __future__ import annotations

import pytest

from ic.text.files import LIBRARY
from met.cli import main
from tests.docs.pages import DOCS

PAGE = (DOCS / "verification.md").read_text(encoding="utf-8")


def test_the_assumptions_are_those_that_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["explain", f"{LIBRARY / 'two_link.ic'}", "--assumptions"]) == 0
    shown = "".join(f"    {line}\n" for line in capsys.readouterr().out.splitlines())
    assert f"    $ met explain two_link.ic --assumptions\n{shown}\n" in PAGE
