"""Macros that the text around their uses takes apart are told of, and those that are not give the same value."""

from __future__ import annotations

import pytest

import ic
from tests.ic.small_decks import ARM, RUN, SERVO

TAKEN = [
    ("#define TWICE(x) x * 2\n", "TWICE(1 + 2)", "x * 2", "(x) * 2"),
    ("#define TWICE(x) 2 * x\n", "TWICE(1 + 2)", "2 * x", "2 * (x)"),
    ("#define LESS(x) 9 - x\n", "LESS(1 + 2)", "9 - x", "9 - (x)"),
    ("#define SQUARE(x) x ^ 2\n", "SQUARE(3 * 2)", "x ^ 2", "(x) ^ 2"),
    ("#define BACK -2\n", "BACK ^ 2", "-2", "(-2)"),
]
SAME = [
    ("#define TWICE(x) x * 2\n", "TWICE(3 * 2)"),
    ("#define TWICE(x) x * 2\n", "TWICE((1 + 2))"),
    ("#define MORE(x) 1 + x\n", "MORE(3 - 2)"),
    ("#define MORE(x) x + 1\n", "MORE(3 * 2)"),
    ("#define BACK -2\n", "3 * BACK"),
    ("#define BACK -2\n", "-2 ^ 2 + BACK"),
]
MACROS = "#define SUM 1 + 4\n#define LESS 5 - 3\n#define TIMES 2 * 3\n#define OF(x) x + 1\n#define SAFE (1 + 4)\n"


def told(value: str, macros: str = MACROS) -> list[str]:
    return [each.code for each in ic.check(text=f"deck 2;\n{macros}let x = {value};\n{ARM}{SERVO}{RUN}").diagnostics]


@pytest.mark.slow
@pytest.mark.parametrize(
    "value",
    [
        "2 * SUM",
        "SUM * 2",
        "SUM / 2",
        "10 - SUM",
        "-SUM",
        "SUM * SUM",
        "3 - LESS",
        "2 / TIMES",
        "3 * OF(2)",
        "OF(2) ^ 2",
    ],
)
def test_a_macro_that_is_taken_apart_is_told_and_brackets_mend_it(value: str) -> None:
    assert told(value) == ["D389"]
    mended = MACROS.replace("1 + 4", "(1 + 4)").replace("5 - 3", "(5 - 3)").replace("2 * 3", "(2 * 3)")
    assert told(value, mended.replace("x + 1", "(x + 1)")) == []


def test_a_macro_that_means_the_same_as_with_brackets_is_not_told() -> None:
    same = [
        "SUM",
        "SUM + 2",
        "2 + SUM",
        "SUM - 2",
        "2 + LESS",
        "2 * TIMES",
        "-TIMES",
        "2 - TIMES",
        "OF(3 - 1)",
        "2 * SAFE",
    ]
    assert told(f"[{', '.join(same)}]") == []
    assert told(f"[{', '.join(same)}, 2 * SUM]") == ["D389"]


@pytest.mark.parametrize(("macro", "value", "without", "brackets"), TAKEN)
def test_an_argument_and_a_sign_that_are_taken_apart_are_told(
    macro: str, value: str, without: str, brackets: str
) -> None:
    assert told(value, macro) == ["D389"]
    assert told(value, macro.replace(without, brackets)) == []


@pytest.mark.parametrize(("macro", "value"), SAME)
def test_an_argument_and_a_sign_that_stay_whole_are_not(macro: str, value: str) -> None:
    assert told(value, macro) == []
