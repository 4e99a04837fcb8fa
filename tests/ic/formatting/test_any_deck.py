"""What holds of every deck that is laid out: the same tokens, comments and meaning, and nothing to do the second time.

Standard decks and those of the pages are laid out already.
"""

from __future__ import annotations

import difflib
import random
import re
from pathlib import Path

import pytest

import ic
from ic.formatting.files import making_strings
from ic.formatting.formatter import formatted, laid_out, prove
from ic.formatting.rows import rows
from ic.text.files import FoundFile
from ic.text.lexer import Text
from ic.text.preprocess import preprocess
from met.diagnostic import Problem
from tests.ic.test_mutilated_decks import mutilated

ROOT = Path(__file__).parents[3]
STANDARD = sorted((Path(ic.__file__).parent / "decks").rglob("*.ic"))
OF_MISTAKES = ROOT / "docs" / "diagnostics.md"
PAGES = sorted({ROOT / "README.md", *(ROOT / "docs").glob("*.md")} - {OF_MISTAKES})
BLOCK = re.compile(r"^```c\n(.*?)^```", re.DOTALL | re.MULTILINE)
SHOWN = [(page.name, text) for page in PAGES for text in BLOCK.findall(page.read_text(encoding="utf-8"))]
DECKS = [(path.name, path.read_text(encoding="utf-8")) for path in STANDARD] + SHOWN
ADDED = (
    " ", "   ", "\t", "\n", "\n\n\n", "  // why\n", "/* what */", "/* a\n  b */", "\\\n", "#if X\n", "\n#else\n",
    "\n#endif\n", "#define SAID(X) #X\n", "SAID(a  +b)", "{", "}", "(", "]", "=", "-", "..", ".", "1", "m", "1/s", "^",
    '"', "'", "\\",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), DECKS, ids=[name for name, _ in DECKS])
def test_the_decks_of_the_library_and_of_the_pages_are_laid_out(name: str, text: str) -> None:
    after = formatted(name, text)
    assert after == text, "".join(difflib.unified_diff(text.splitlines(True), after.splitlines(True), name, "laid out"))


def ruffled(seed: int) -> str:
    """A deck with blanks, lines, comments, brackets and more put in and taken away."""
    pick = random.Random(seed)
    words = re.findall(r"//[^\n]*|[A-Za-z_]\w*|\d[\d.e-]*|[ \t]+|.", pick.choice(DECKS)[1], re.DOTALL)
    for _ in range(pick.choice([1, 2, 5, 20, 60])):
        i, how = pick.randrange(len(words)), pick.random()
        if how < 0.4:
            words[i] = pick.choice(["", " ", "   ", "\t"]) if not words[i].strip(" \t") else words[i]
        elif how < 0.75:
            words[i] += pick.choice(ADDED)
        elif how < 0.85:
            words[i] = ""
        else:
            j = pick.randrange(len(words))
            words[i], words[j] = words[j], words[i]
    return "".join(words)


def check(folder: Path, text: str, seed: int) -> bool:
    """Whether a deck can be laid out; what holds then, and what is said if not."""
    file = FoundFile(str(folder / "a.ic"), "a.ic")
    strings = making_strings(text, file)
    try:
        after = formatted("a.ic", text, strings)
    except Problem as problem:
        assert "E340" not in {diagnostic.code for diagnostic in problem.diagnostics}, seed
        assert all(diagnostic.at is not None for diagnostic in problem.diagnostics), seed
        return False
    assert formatted("a.ic", after, strings) == after, seed
    assert meaning(folder, after) == meaning(folder, text), seed
    return True


def meaning(folder: Path, text: str) -> list[str]:
    """What the parser gets of a deck."""
    (folder / "a.ic").write_text(text, encoding="utf-8")
    return [token.text for token in preprocess(folder / "a.ic").tokens]


@pytest.mark.release
@pytest.mark.parametrize("first", range(0, 300, 50))
def test_a_ruffled_deck_keeps_its_tokens_and_is_done_at_once(tmp_path: Path, first: int) -> None:
    outcomes = [check(tmp_path, ruffled(seed), seed) for seed in range(first, first + 50)]
    assert any(outcomes) and not all(outcomes)


@pytest.mark.release
def test_a_mutilated_deck_is_laid_out_or_told_where_it_is_broken(tmp_path: Path) -> None:
    outcomes = [check(tmp_path, mutilated(seed), seed) for seed in range(60)]
    assert any(outcomes) and not all(outcomes)


@pytest.mark.release
@pytest.mark.parametrize("first", range(1000, 2000, 500))
def test_a_thousand_ruffled_decks_keep_their_tokens(tmp_path: Path, first: int) -> None:
    for seed in range(first, first + 500):
        check(tmp_path, ruffled(seed), seed)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "text"), DECKS, ids=[name for name, _ in DECKS])
def test_a_deck_whose_indentation_is_lost_gets_it_back(name: str, text: str) -> None:
    text = formatted(name, re.sub(r"(?<=\S) +//.*", "", text))  # how far out such a comment is, depends on its line
    flat = re.sub(r"(?<!\\\n)^ +(?=[^ #])", "", text, flags=re.MULTILINE)  # but for bodies of macros
    assert laid_out(rows(Text(name, flat))) == text


@pytest.mark.release
@pytest.mark.parametrize("text", [
    "a = [" + "1,\n" * 5_000 + "1];\n",
    "\n".join("a" * (i % 7 + 1) + "  = " * 20 + ";" for i in range(200)),
    "\n".join("  ".join("ab"[i * j % 2] * ((i + j) % 3 + 1) for j in range(60)) + ";" for i in range(300)),
    "a = b;\t" * 5_000,
    "a /*x*/ = " * 5_000,
    "let a = 1;   // x\n" * 5_000,
    "{\n" * 40 + "}\n" * 40,
], ids=["list", "signs", "columns", "tabs", "comments", "tails", "deep"])  # fmt: skip
def test_a_large_or_odd_deck_is_laid_out(text: str) -> None:
    after = formatted("a.ic", text)
    prove("a.ic", text, after)


@pytest.mark.parametrize("text", ["{" * 41 + "}" * 41, "#if A\n" * 101 + "#endif\n" * 101, "a" * 200_001])
def test_a_deck_that_is_more_than_a_reader_takes_is_refused(text: str) -> None:
    with pytest.raises(Problem, match=r"D029|D018"):
        formatted("a.ic", text)


def test_a_character_that_is_not_seen_is_refused_where_a_deck_is_read_as_one() -> None:
    with pytest.raises(Problem, match=r"D038\]: U\+202E"):
        formatted("a.ic", "run a \u202e b = 3; }\n")
