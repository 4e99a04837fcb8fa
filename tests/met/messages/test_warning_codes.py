"""The table of warnings' codes is that of the source: what it lacks could not be allowed."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from met.messages.warning_codes import WARNINGS, WHILE_RUNNING

ROOT = Path(__file__).parents[3]
SPOKEN = ("warn", "remark", "_warning")
"""Functions whose first argument is a code."""

ELSEWHERE = {"D003", "D015", "D317", "D318", "D319", "D320", "D322"}
"""Given by a function that is chosen, `tell`, an error or a warning; or by a code that is chosen, of a step or loop."""

OF_NO_RUN = {"D333", "E405", "E444"}
"""Of an `allow` that silences nothing, of a computer's serial line, and of a bench's file."""


def in_the_source() -> Iterator[str]:
    for room in ("met", "ic", "batch", "hw"):
        for file in (ROOT / room).rglob("*.py"):
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if not isinstance(node, ast.Call):
                    continue
                words = [each.value for each in node.args if isinstance(each, ast.Constant)]
                words += [each.value.value for each in node.keywords if isinstance(each.value, ast.Constant)]
                name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                if name in SPOKEN or (name == "Diagnostic" and "warning" in words):
                    yield from (str(each) for each in words[:1] if len(str(each)) == 4)


@pytest.mark.release
def test_the_table_has_every_code_that_warns_and_no_other() -> None:
    assert {*in_the_source(), *ELSEWHERE} - OF_NO_RUN == WARNINGS


def test_codes_of_runs_are_among_them() -> None:
    assert WHILE_RUNNING <= WARNINGS
