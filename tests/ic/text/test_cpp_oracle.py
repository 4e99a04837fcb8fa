"""gcc's preprocessor is the oracle for ours: what both make of a text, cut into tokens, is the same."""

from __future__ import annotations

import random
import re
import shutil
import subprocess
from collections.abc import Mapping
from pathlib import Path

import pytest

from ic.text.lexer import Text, logical_lines
from tests.ic.decktext import Desk
from tests.ic.text import deferred_macros
from tests.ic.text.random_macros import program

TEXTS = Path(__file__).with_name("cpp")
HEAD = """\
#define X 3
#define Y
#define SH 3
#define fn(a) a*2
#define id(a) a
#define DEF defined X
#define XP 3+
"""


def texts(name: str) -> list[object]:
    """The texts of a file in `cpp/`, each with the files that it includes, named by topic and number."""
    found: list[object] = []
    topics = re.split(r"^=== (.*)\n", TEXTS.joinpath(name).read_text(), flags=re.MULTILINE)[1:]
    for topic, body in zip(topics[::2], topics[1::2], strict=True):
        for number, one in enumerate(re.split(r"^%%\n", body, flags=re.MULTILINE), 1):
            text, *files = re.split(r"^-- (.*)\n", one, flags=re.MULTILINE)
            others = dict(zip(files[::2], files[1::2], strict=True))
            found.append(pytest.param(text, others, id=f"{topic} {number}"))
    return found


IN_LITTLE_MEMORY = ("/bin/sh", "-c", 'ulimit -v 1048576; exec "$@"', "sh")
"""A text that grows without end fails in gcc before it takes the machine's memory."""


def theirs(desk: Desk, text: str, others: Mapping[str, str]) -> list[str] | None:
    """The tokens of gcc's output, by our lexer; None where gcc refuses the text. Its own dialect: no trigraphs."""
    cpp = shutil.which("cpp")
    if cpp is None:
        pytest.skip("gcc's preprocessor is the oracle of this test")
    for name, other in others.items():
        desk.write(other, name)
    words = [*IN_LITTLE_MEMORY, cpp, "-P", "-nostdinc", "-undef", "-std=gnu11", "-Ilibrary", desk.write(text)]
    done = subprocess.run(words, cwd=desk.directory, capture_output=True, text=True, check=False, timeout=60)
    cut = [t.text for line in logical_lines(Text("", done.stdout)) for t in line if t.text.strip()]
    return None if done.returncode else cut


def ours(desk: Desk, text: str) -> list[str] | None:
    """The tokens of ours; None where a message refuses it."""
    made = desk.tokens(text)
    refused = any(d.severity == "error" for d in made.diagnostics)
    return None if refused else [token.text for token in made.tokens[:-1]]


@pytest.mark.compiler
@pytest.mark.parametrize(("text", "others"), texts("macros.txt"))
def test_a_text_is_read_as_gcc_reads_it(desk: Desk, text: str, others: dict[str, str]) -> None:
    expected = theirs(desk, text, others)
    assert expected is not None
    assert ours(desk, text) == expected


@pytest.mark.compiler
@pytest.mark.parametrize(("text", "others"), texts("refused.txt"))
def test_what_gcc_refuses_is_refused(desk: Desk, text: str, others: dict[str, str]) -> None:
    assert theirs(desk, text, others) is None
    assert ours(desk, text) is None


@pytest.mark.compiler
@pytest.mark.parametrize("condition", TEXTS.joinpath("conditions.txt").read_text().splitlines())
def test_a_condition_holds_where_gcc_says_so(desk: Desk, condition: str) -> None:
    text = f"{HEAD}#if {condition}\nyes\n#else\nno\n#endif\n"
    assert ours(desk, text) == theirs(desk, text, {})


# Where a deck is not C, on purpose: why, the text, and what ours makes of it (None: it is refused).

NUMBERS = "a number of a deck ends where its unit begins; in C `10mm` or `0b1` is one token"
SILENT = "gcc warns or says nothing, and goes on; in a deck nothing is ignored in silence"
PLAIN = "text that no deck has a use for is refused where it reaches the deck, even though C passes it on"
SAME = "a deck means the same wherever and whenever it is read, and messages tell where a thing really stands"
UNDEFINED = "C leaves it open"

DELIBERATE = [
    ("units keep their names", "#define N 6\n2 N", None),
    ("units keep their names", "#define ROD(m) 2 m\nROD(2)", None),
    (NUMBERS, "#define X(a) a##B\nX(1)", None),
    (NUMBERS, "#define D .\n1D", ["1", "."]),
    (NUMBERS, "#define e 9\n1e", ["1", "9"]),
    (NUMBERS, "#define x 9\n0x", ["0", "9"]),
    (NUMBERS, "#if 0b101 == 5\nyes\n#endif", None),
    (SILENT, "#define X 1\n#define X 2", None),
    (SILENT, "#define FN(a) a\n#define FN(b) b", None),
    (SILENT, "#define X (a)\n#define X ( a )", None),
    (SILENT, "#if 0\n#else x\n#endif", None),
    (SILENT, "#ifdef X Y\n#endif", None),
    (SILENT, "#undef X Y", None),
    (SILENT, "#if 99999999999999999999999\nyes\n#endif", None),
    (SILENT, "#ident \"x\"", None),
    (SILENT, "#3", None),
    (SILENT, "#pragma pack", None),
    (SILENT, '"open', None),
    (SILENT, "'open", None),
    (PLAIN, "x # y", None),
    (PLAIN, "'c'", None),
    (PLAIN, "a$b @ `", None),
    (PLAIN, "\\n", None),
    (PLAIN, "#define S(a) #a\nS(at\\n)", None),
    (PLAIN, "caf\u00e9", None),
    (PLAIN, "%:define X 1", ["%", ":", "define", "X", "1"]),
    (SAME, "#line 7\n__LINE__", None),
    (SAME, "__DATE__", None),
    (SAME, "__STDC__ __INCLUDE_LEVEL__", ["__STDC__", "__INCLUDE_LEVEL__"]),
    ("conditions are read before the text in front of them", "#if __COUNTER__ == 0\nyes\n#endif", None),
    (SAME, "#if __has_include(\"x\")\n#endif", None),
    ("a `#pragma` is `once`, and that is a line", '_Pragma("once")', ["_Pragma", "(", '"once"', ")"]),
    ("gcc's own: in C the rest of the arguments is `__VA_ARGS__`", "#define V1(args...) f(args)\nV1(1, 2)", None),
    (UNDEFINED, "#define __VA_ARGS__ 1", None),
    (UNDEFINED, "#define F2(x, y) [x y]\nF2(\n#define Z\n1, 2)", None),
    (UNDEFINED, "#define X 3\n#define id(a) a\n#if id(defined X)\nyes\n#endif", ["yes"]),
    (UNDEFINED, "#if 5 << 64\nyes\n#endif\nno", None),
    (UNDEFINED, "#if 1 >> -1\nyes\n#endif\nno", None),
    (UNDEFINED, "#if 'ab'\nyes\n#endif\nno", None),
    ("gcc keeps the space in a file's name that a macro made", "#define LT <\n#include LT c.ic>", ["c"]),
]  # fmt: skip


@pytest.mark.compiler
@pytest.mark.parametrize(("reason", "text", "made"), DELIBERATE, ids=[text for _, text, _ in DELIBERATE])
def test_where_a_deck_is_not_c_there_is_a_reason(desk: Desk, reason: str, text: str, made: list[str] | None) -> None:
    others = {"library/c.ic": "c"}
    assert theirs(desk, text, others) != made, "not a difference any more"
    assert ours(desk, text) == made, reason


def compare_random_programs(desk: Desk, seed: int, count: int, circles: bool) -> int:
    """How many of the programs both expand; those that one refuses, the other refuses too."""
    rng = random.Random(seed)
    compared = 0
    for _ in range(count):
        # of macros that use each other in circles C does not say all, and some uses outgrow our limits
        text = program(rng, rng.randint(1, 3) if circles else 6, circles)
        made = ours(desk, text)
        if made is None and any(d.code == "D019" for d in desk.tokens(text).diagnostics):
            continue  # tokens that `##` makes are not C's: a number ends where its unit begins
        expected = theirs(desk, text, {})
        if ", ## __VA_ARGS__" in text:
            made, expected = _without_gccs_blanks(made), _without_gccs_blanks(expected)
        assert made == expected, f"seed {seed}\n{text}"
        compared += made is not None
    return compared


def _without_gccs_blanks(tokens: list[str] | None) -> list[str] | None:
    """Strings without the blank behind a comma: whether `, ## __VA_ARGS__` leaves one there is gcc's own affair.

    It depends on whether the blank before the arguments was written or came out of another macro.
    """
    return tokens and [token.replace(", ", ",") if token.startswith('"') else token for token in tokens]


@pytest.mark.compiler
@pytest.mark.parametrize("circles", [True, False])
@pytest.mark.parametrize("seed", range(10))
def test_random_macros_expand_as_gcc_expands_them(desk: Desk, seed: int, circles: bool) -> None:
    assert compare_random_programs(desk, seed, 6, circles) >= 1


@pytest.mark.release
@pytest.mark.parametrize("circles", [True, False])
def test_hundreds_of_random_macros_expand_as_gcc_expands_them(desk: Desk, circles: bool) -> None:
    """gcc takes 20 times as long to start as a program takes to expand; 2,000 of this seed were the same too."""
    assert compare_random_programs(desk, 20_261_121, 300, circles) >= 75


DEFERRED = TEXTS.joinpath("deferred.txt").read_text().split("%%\n")


@pytest.mark.slow
@pytest.mark.parametrize("stored", DEFERRED, ids=range(len(DEFERRED)))
def test_calls_that_are_put_off_expand_as_gcc_has_expanded_them(desk: Desk, stored: str) -> None:
    text, _, expected = stored.rpartition("-> ")
    assert ours(desk, deferred_macros.HEAD + text) == expected.split()


OWN_LIMITS = {"D013", "D018", "D019", "D020"}
"""Tokens that are not C's, and texts that outgrow our limits: gcc has none, and such a text may fill its memory."""


@pytest.mark.release
@pytest.mark.parametrize(("kind", "least"), [("program", 270), ("optional_program", 150)])
def test_hundreds_of_calls_that_are_put_off_expand_as_gcc_expands_them(desk: Desk, kind: str, least: int) -> None:
    rng, compared = random.Random(20_261_122), 0
    for _ in range(300):
        text = getattr(deferred_macros, kind)(rng)
        made = ours(desk, text)
        if made is None and OWN_LIMITS & {d.code for d in desk.tokens(text).diagnostics}:
            continue
        assert made == theirs(desk, text, {}), text
        compared += made is not None
    assert compared >= least


if __name__ == "__main__":  # writes cpp/deferred.txt anew: `python -m tests.ic.text.test_cpp_oracle`
    import contextlib
    import tempfile

    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        desk = Desk(Path(folder))
        rng, stored, known = random.Random(22), [], (deferred_macros.program, deferred_macros.optional_program)
        while len(stored) < 120:
            text = known[len(stored) % 3 == 2](rng)
            tokens = theirs(desk, text, {})
            refused = ours(desk, text) is None and "D019" in {d.code for d in desk.tokens(text).diagnostics}
            if tokens is not None and len(tokens) < 60 and not refused and not any(" " in token for token in tokens):
                stored.append(f"{text.removeprefix(deferred_macros.HEAD)}-> {' '.join(tokens)}\n")
        TEXTS.joinpath("deferred.txt").write_text("%%\n".join(stored))
