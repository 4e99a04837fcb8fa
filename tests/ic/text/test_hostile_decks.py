"""Hostile decks: a diagnostic within seconds, in bounded memory; and long ones, whose cost grows with their length."""

from __future__ import annotations

import time

import pytest

from tests.ic.decktext import Desk

DOUBLING = "#define A0 x x\n" + "".join(f"#define A{i} A{i - 1} A{i - 1}\n" for i in range(1, 50)) + "A49"


def _nested(name: str, count: int) -> str:
    return f"{name}(" * count + "1" + ")" * count


@pytest.mark.release
@pytest.mark.parametrize(
    ("text", "code"),
    [
        pytest.param(DOUBLING, "D013", id="doubling names"),
        pytest.param("#define D(x) x x\n" + _nested("D", 50), "D013", id="doubling arguments"),
        pytest.param("#define P(x) x##x\n#define Q(x) P(x)\n" + _nested("Q", 50), "D013", id="doubling by pasting"),
        pytest.param("#define S(x) #x\n#define Q(x) S(x)\n" + _nested("Q", 50), "D013", id="doubling by quoting"),
        pytest.param("#define D(x) x\n" + _nested("D", 5000), "D013", id="deep arguments"),
        pytest.param("".join(f"#define A{i} A{i + 1}\n" for i in range(200)) + "A0", "D013", id="a long chain"),
        pytest.param("#define B(x) " + "x " * 2000 + "\nB(" + "1 " * 9000 + ")", "D013", id="a long body"),
        pytest.param("#define B(x) x\nB(" + "1 " * 30000 + ")", "D018", id="long arguments"),
        pytest.param("#define B " + "x " * 5000, "D018", id="a very long body"),
        pytest.param("#if 1\n" * 5000, "D018", id="deep conditions"),
        pytest.param("#if " + "1+" * 5000 + "1\n#endif", "D018", id="a long condition"),
        pytest.param("#if 1\n#endif\n" * 12000, "D018", id="many conditions"),
        pytest.param("x" * 300_000, "D018", id="a long line"),
        pytest.param("{" * 1_000_000, "D018", id="a million braces"),
        pytest.param("{\n" * 1_000_000, "D018", id="a million braces on a million lines"),
        pytest.param("a \\\n" * 400_000, "D018", id="half a million joined lines"),
        pytest.param("a\n" * 3_000_000, "D018", id="a large file"),
        pytest.param('#include "a.ic"\n#include "a.ic"\n', "D006", id="a file that includes itself twice"),
        pytest.param("$\n" * 100_000, "D018", id="nothing but mistakes"),
    ],
)  # fmt: skip
def test_a_hostile_deck_ends_in_a_diagnostic(desk: Desk, text: str, code: str):
    """In half a second of all, where without limits it would be hours; tests/costs.py sees to that."""
    desk.write(text)
    made = desk.tokens(text)
    assert code in [d.code for d in made.diagnostics]


@pytest.mark.slow
@pytest.mark.parametrize("line", [
    "// " + "x" * 199_000, "/*" + "* " * 99_000 + "*/", "// " + "x \\\n" * 30_000, '"' + "x" * 199_000 + '"',
    " " * 199_000, "/**/" * 20_000, "\\" + " " * 190_000, "#if 0 // " + "x" * 190_000 + "\n#endif",
    "let " + "x" * 190_000 + " = 1;",
], ids=lambda line: line[:12])  # fmt: skip
def test_very_long_lines_cost_time_in_proportion(desk: Desk, line: str):
    """0.3 s of all; a search that began anew at each character would take 50. tests/costs.py sees to that."""
    desk.write(f"{line}\n" * 10)
    desk.tokens(f"{line}\n" * 10)


@pytest.mark.slow
def test_macros_in_ten_thousand_lines_cost_time_in_proportion(desk: Desk):
    head = "#define REACH 2.0 m\n#define ROD(NAME, MASS) link NAME { mass = MASS; at = REACH; }\n"

    def seconds(lines: int) -> float:
        text = head + "".join(f"ROD(l{i}, 40 kg) x{i} = REACH;\n" for i in range(lines))
        start = time.process_time()
        assert len(desk.tokens(text).tokens) == 19 * lines + 1
        return time.process_time() - start

    few, many = seconds(1000), seconds(10_000)
    # tenfold work: a quadratic step would make it a hundredfold
    assert many < 30 * few
