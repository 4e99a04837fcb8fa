"""What the fuzzer starts from, gathered anew each time: every deck in the tree, and every word of the language."""

from __future__ import annotations

import ast
import random
import re
from collections.abc import Iterator
from contextlib import chdir
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import get_args

import ic
from ic.text.preprocess import DIRECTIVES
from met import models, units

ROOT = Path(__file__).parents[3]
KINDS: tuple[models.Kind, ...] = get_args(models.Kind)
LIBRARY = tuple(str(path.relative_to(ROOT / "ic" / "decks")) for path in sorted(ROOT.glob("ic/decks/**/*.ic")))
LARGEST = 20_000  # characters of a deck to start from
COMPANIONS = ("*.csv", "*.urdf", "*.xacro")

SYMBOLS = (
    "{", "}", "(", ")", "[", "]", ";", ",", ".", "..", "=", "+=", "==", "<", ">", "<=", ">=", "!=", "+", "-", "*", "/",
    "^", "%", "#", "##", "...", ":", "?", "!", "&", "&&", "|", "||", "~", "\\", '"', "'",
)  # fmt: skip
NUMBERS = (
    "0", "1", "2", "3", "7", "-1", "0.5", ".5", "5.", "1e-3", "1e308", "1e309", "1e-308", "1e-400", "0x10", "0.1",
    "100", "1000000", "999999999999", "1/0", "0.0", "3.14159", "9" * 70,
)  # fmt: skip
STRANGE = (
    "// comment\n", "/* comment */", "/*", '"', "'", "\\\n", "\n", "\t", "#if 1\n", "#if 0\n", "#endif\n", "#else\n",
    '#include "deck.ic"\n', "#include <two_link.ic>\n", "#include <servos/rigid_gearbox.ic>\n", "\n#undef X\n",
    "deck 2;\n", "deck 1;\n", "unit ozin = 7.061552e-3 N*m;\n", " ozin", "let m = 2 kg;\n", "2 m/s", "1/2 m",
    "use <panda.ic> as panda;\n", 'use "deck.ic" as', "panda.panda", "panda.d1", "like panda.panda_large",
    "with panda.d1 =", "param size = 1 m;\n", "with links.bar.mass = 2 kg;", "with size = [1, 2];",
    "for i in 0 .. 2 {", "for side in [left, right] {", "by -1", "_{i}", "{i}", "{side}_x", "[i]", "[a, b] = ", "* = ",
    'let rows = csv("rows.csv");\n', "rows.bar.mass", "rows.{side}.com", "rows.bar.inertia", 'csv("rows.csv")', "csv(",
    "initial { q = command; qd = command; }", "= command;", "rate(pulse(to = 1 rad/s, slope = 2 rad/s^2, over = 3 s))",
    "_{ i }", "{ i - 1 }_", 'with rows = csv("x.csv");',
    "#define X ", "floor(", "round(1.5)", "sign(", ".x", "* [1, 2, 3] m", "-[1, 2, 3]", "/ 2",
    "#define FN(a, ...) a __VA_ARGS__\n", "FN(", "#pragma once\n", "__LINE__", "__FILE__", "__DATE__", '"x.csv"',
    '"../deck.ic"', "\u00b5", "\u00a0", "\u202e", "\x00", "\x1b", "\ufeff", "\U0001f600",
)  # fmt: skip


ROWS = (
    b"link,mass [kg],com.x [m],com.y [m],com.z [m],inertia.xx [kg*m^2],inertia.yy [kg*m^2],inertia.zz [kg*m^2],by\n"
    b"bar,2,0.5,0,0,0.1,0.2,0.2,scale\nleft,,1,0,0,0.1,0.2,0.2,-\nseg_1,1e308,1,0,0,0.1,0.2,0.2,7\n"
)
"""A table by row name, with an empty cell, remarks, and a mass that is very large."""

_HEAD = re.compile(r"(?<![\w.])([a-z]+)\b[^;{}()=\"#\n]*\{")
_ENTRY = re.compile(r"(?<![\w.])([a-z]+)\b[^;{}#\"]*;")
_BRACE = re.compile(r"[;{}]")


@cache
def decks() -> tuple[str, ...]:
    """The texts of all decks: the library's, those of the documentation and of the tests, whole or in part."""
    found = [path.read_text(encoding="utf-8", errors="replace") for path in sorted(ROOT.glob("[!.]*/**/*.ic"))]
    for page in [*sorted(ROOT.glob("docs/*.md")), ROOT / "README.md"]:
        found += _decks_of_page(page.read_text(encoding="utf-8"))
    for path in sorted(ROOT.glob("tests/**/*.py")):
        found += [text for text in _strings(path) if _looks_like_a_deck(text)]
    return tuple(dict.fromkeys(text for text in found if len(text) <= LARGEST))


def _decks_of_page(page: str) -> list[str]:
    """The decks of a page of the documentation, each piece put where the comment before it says that it belongs."""
    files = _files_of_page(page)
    base = next((text for name, text in files.items() if name.endswith(".ic")), "")
    found = [text for name, text in files.items() if name.endswith(".ic")]
    for where, text in re.findall(r"^<!-- ([a-z ]+)(?:: \w+)? -->\n```c\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        kind = where.removeprefix("in ")
        of, word = ("run", "of") if kind == "sweep" else (kind, "like")
        like = re.search(rf"^(?:default )?{of} (\w+)", base, re.MULTILINE)
        inside = f"{kind} fuzzed {word} {like[1]} {{ {text} }}" if like and where.startswith("in ") else text
        found += [base + inside, text]
    return [*found, *re.findall(r"^```c\n(.*?)^```", page, re.DOTALL | re.MULTILINE)]


def _files_of_page(page: str) -> dict[str, str]:
    """What the page gives the name of a file, its pieces one after the other."""
    files: dict[str, str] = {}
    for name, text in re.findall(r"^<!-- ([\w]+\.\w+)[^\n]* -->\n```\w*\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        files[name] = files.get(name, "") + text
    return files


def sound_deck(rng: random.Random) -> str:
    """One of those that give a plan with something to run; they are tried by chance until one does."""
    while not _is_sound(text := rng.choice(_long_decks())):
        pass
    return text


@cache
def _long_decks() -> tuple[str, ...]:
    return tuple(text for text in decks() if len(text) > 300)


@cache
def _is_sound(text: str) -> bool:
    with chdir(_folder().name):
        Path("deck.ic").write_text(text, encoding="utf-8", errors="replace")
        try:
            compiled = ic.check("deck.ic", select="all")
        except Exception:  # that is for the fuzzer to find, and to tell
            return True
        return compiled.plan is not None and bool(compiled.plan.experiments)


@cache
def _folder() -> TemporaryDirectory[str]:
    """A folder with the companions as they are, whatever the fuzzer makes of them elsewhere."""
    folder = TemporaryDirectory(prefix="met-sound-", ignore_cleanup_errors=True)
    for name, data in companions():
        Path(folder.name, name).write_bytes(data)
    return folder


@cache
def blocks() -> dict[str, tuple[str, ...]]:
    """All blocks of all decks, by their first word: `sweep`, `joint`, `zip`, ..."""
    found: dict[str, dict[str, None]] = {}
    for text in decks():
        for match in _HEAD.finditer(text):
            end = end_of_entry(text, match.start())
            if text[end - 1 : end] == "}":
                found.setdefault(match[1], {})[text[match.start() : end]] = None
    return {word: tuple(texts) for word, texts in found.items()}


@cache
def entries() -> dict[str, tuple[str, ...]]:
    """All entries that end in a semicolon, by their first word: `vary`, `metric`, `mass`, ..."""
    found: dict[str, dict[str, None]] = {}
    for text in decks():
        for match in _ENTRY.finditer(text):
            found.setdefault(match[1], {})[match[0]] = None
    return {word: tuple(texts) for word, texts in found.items()}


def end_of_entry(text: str, start: int) -> int:
    """Behind the semicolon or the closing brace that ends what begins at `start`."""
    depth = 0
    for match in _BRACE.finditer(text, start):
        depth += {"{": 1, "}": -1, ";": 0}[match[0]]
        if depth < 0:
            return match.start()
        if depth == 0:
            return match.end()
    return len(text)


@cache
def words() -> tuple[str, ...]:
    """Units, directives, models with their parameters, and every word that the compiler itself compares with."""
    found = [*units.ALL_UNITS, *(f"#{name}" for name in DIRECTIVES), *SYMBOLS, *NUMBERS]
    for kind in KINDS:
        for name, model in models.available(kind).items():
            found += [name, *(parameter.name for parameter in models.written(model))]
    for path in sorted(ROOT.glob("ic/**/*.py")):
        for text in _strings(path):
            found += [word for word in text.split() if len(text) < 80 and re.fullmatch(r"[a-z_]{1,24}", word)]
    return tuple(dict.fromkeys(found))


@cache
def companions() -> tuple[tuple[str, bytes], ...]:
    """Small files that decks name: those of the tests and the documentation, and a table."""
    found = [("x.csv", b"time [s],value [rad/s]\n0,0\n1,0.5\n2,0.25\n"), ("y.csv", b"a,b\n1,2\n"), ("rows.csv", ROWS)]
    for pattern in COMPANIONS:
        for path in sorted(ROOT.glob(f"[!.]*/**/{pattern}")):
            if path.stat().st_size < 100_000:
                found.append((path.name, path.read_bytes()))
    for page in sorted(ROOT.glob("docs/*.md")):
        found += [(name, text.encode()) for name, text in _files_of_page(page.read_text(encoding="utf-8")).items()]
    return tuple({name: (name, data) for name, data in found if name != "deck.ic"}.values())


def _strings(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield node.value


def _looks_like_a_deck(text: str) -> bool:
    return len(text) >= 6 and any(mark in text for mark in ("{", ";", "#")) and not text.startswith(("{", "%"))
