"""Decks that nobody would write: texts of the corpus with bytes, words or whole entries changed."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Sequence
from functools import partial

from ic.text.preprocess import DIRECTIVES
from met import units
from tests.ic.fuzz import corpus

_PIECES = re.compile(r"//[^\n]*\n?|/\*.*?\*/|\"[^\"\n]*\"|[A-Za-z_]\w*|\d[\d.e]*|\s+|.", re.DOTALL)
LONGEST = 60_000  # characters of a made deck


def deck(seed: int, number: int) -> bytes:
    """The deck of that number of a series; the same whenever the corpus is the same."""
    rng = random.Random(f"{seed}/{number}")
    how = rng.random()
    if how < 0.04:
        return soup(rng)
    sound = rng.random() < 0.85
    text = corpus.sound_deck(rng) if sound else rng.choice(corpus.decks())
    if not sound and rng.random() < 0.5:
        text += "\n" + rng.choice(corpus.decks())
    if how < 0.1:
        return changed_bytes(rng, text.encode())
    changes = GENTLE if sound and rng.random() < 0.8 else _WILD
    for _ in range(rng.choice([1, 1, 1, 1, 2, 2, 3, 5])):
        text = rng.choice(changes)(rng, text)
        if len(text) > LONGEST:
            break
    return text[:LONGEST].encode("utf-8", "surrogatepass")


def pieces_of(text: str) -> list[str]:
    """The words, signs, comments and blanks that a text is made of."""
    return _PIECES.findall(text)


def soup(rng: random.Random) -> bytes:
    """Words of the language in any order."""
    pool: Sequence[str] = (*corpus.words(), *corpus.STRANGE) if rng.random() < 0.5 else corpus.SYMBOLS
    gap = rng.choice(["", " ", " ", "\n"])
    return gap.join(rng.choice(pool) for _ in range(rng.randint(1, 200))).encode("utf-8", "surrogatepass")


def changed_bytes(rng: random.Random, data: bytes) -> bytes:
    """Some bytes altered, taken away, repeated or put in."""
    made = bytearray(data[:LONGEST])
    for _ in range(rng.choice([1, 2, 4, 16])):
        at = rng.randrange(len(made) + 1)
        end = min(len(made), at + rng.choice([1, 1, 2, 8, 64]))
        how = rng.randrange(4)
        if how == 0:
            made[at:end] = rng.randbytes(end - at)
        elif how == 1:
            del made[at:end]
        elif how == 2:
            made[at:at] = made[at:end] * rng.choice([1, 2, 50])
        else:
            made[at:at] = bytes(rng.choices(range(32, 127), k=rng.randint(1, 4)))
    return bytes(made)


def changed_word(rng: random.Random, text: str) -> str:
    """A word replaced, dropped, added or put elsewhere."""
    pieces = pieces_of(text)
    solid = _solid(pieces)
    if not solid:
        return text + rng.choice(corpus.words())
    at, how = rng.choice(solid), rng.random()
    if how < 0.3:
        pieces[at] = rng.choice(corpus.words())
    elif how < 0.45:
        pieces[at] = ""
    elif how < 0.65:
        pieces[at] += f" {rng.choice(corpus.words())} "
    elif how < 0.8:
        pieces[at] = rng.choice(corpus.STRANGE)
    else:
        other = rng.choice(solid)
        pieces[at], pieces[other] = pieces[other], pieces[at]
    return "".join(pieces)


def word_of_its_kind(rng: random.Random, text: str) -> str:
    """A name in the place of a name, a number in that of a number."""
    pieces = pieces_of(text)
    solid = [i for i in _solid(pieces) if pieces[i][0].isalnum()]
    if solid:
        at = rng.choice(solid)
        own = [piece for piece in pieces if piece[0].isalnum() and piece[0].isdigit() == pieces[at][0].isdigit()]
        names = [word for word in corpus.words() if word[0].isalpha()]
        others = names if pieces[at][0].isalpha() else list(corpus.NUMBERS)
        pieces[at] = rng.choice(own if rng.random() < 0.6 else others)
    return "".join(pieces)


def other_block(rng: random.Random, text: str) -> str:
    """A block, or an entry, of another deck: in the place of one that begins alike, or beside one."""
    whole = rng.random() < 0.5
    known = corpus.blocks() if whole else corpus.entries()
    spots = [match for match in re.finditer(r"(?<![\w.#])([a-z]+)\b", text) if match[1] in known]
    if not spots:
        return text
    spot = rng.choice(spots)
    word = spot[1] if rng.random() < 0.7 else rng.choice(list(known))
    other = rng.choice(known[word])
    end = corpus.end_of_entry(text, spot.start())
    return text[: spot.start()] + other + "\n" + text[end if rng.random() < 0.5 else spot.start() :]


def changed_number(rng: random.Random, text: str) -> str:
    """A number that is strange, or a size that is large."""
    spots = list(re.finditer(r"(?<![\w.])\d[\d.e]*", text))
    if not spots:
        return text
    spot = rng.choice(spots)
    return text[: spot.start()] + rng.choice(corpus.NUMBERS) + text[spot.end() :]


def changed_entry(rng: random.Random, text: str) -> str:
    """An entry or block left out, doubled, emptied, or moved to another place."""
    ends = [match.end() for match in re.finditer(r"[;{}]", text)]
    if len(ends) < 3:
        return text
    first = rng.randrange(len(ends) - 1)
    start, end = ends[first], corpus.end_of_entry(text, ends[first])
    entry, how = text[start:end], rng.randrange(4)
    if how == 0:
        return text[:start] + text[end:]
    if how == 1:
        return text[:end] + entry + text[end:]
    if how == 2 and "{" in entry:
        return text[:start] + entry[: entry.index("{")] + "{ }" + text[end:]
    to = rng.choice(ends)
    return text[:to] + entry + text[to:]


def through_macro(rng: random.Random, text: str) -> str:
    """A stretch of the text made a macro's body or its argument."""
    pieces = pieces_of(text)
    if len(pieces) < 4:
        return text
    start = rng.randrange(len(pieces) - 2)
    end = min(len(pieces), start + rng.choice([1, 3, 9, 40]))
    body = "".join(pieces[start:end])
    before, after = "".join(pieces[:start]), "".join(pieces[end:])
    name = f"MACRO{rng.randrange(3)}"
    joined = body.replace("\n", " \\\n")
    forms = (
        f"#define {name} {joined}\n{before} {name} {after}",
        f"#define {name}(a) {joined} a\n{before} {name}({rng.choice(pieces).strip()}) {after}",
        f"#define {name}(a) a a\n{before} {name}({body}) {after}",
        f"#define {name}(a, ...) a #a __VA_ARGS__ a##a\n{before} {name}({body}) {after}",
        f"{before}\n#if {body}\n{after}",
        f"{before}\n#{rng.choice(DIRECTIVES)} {body}\n{after}",
    )
    return rng.choice(forms)


def in_a_loop(rng: random.Random, text: str) -> str:
    """An entry or block repeated by a loop; some of its names and numbers have the index."""
    ends = [match.end() for match in re.finditer(r"[;{}]", text)]
    if not ends:
        return text
    start = rng.choice(ends)
    end = corpus.end_of_entry(text, start)
    entry = pieces_of(text[start:end])
    for at, piece in enumerate(entry):
        if piece[:1].isalpha() and rng.random() < 0.4:
            entry[at] = rng.choice([piece + "_{i}", "{i}", "i", piece + "{i-1}", piece + "_{i/2}", piece + "[i]"])
        elif piece[:1].isdigit() and rng.random() < 0.5:
            entry[at] = rng.choice(["i", "(i * 0.1)", "-i", f"i{piece}"])
    turns = rng.choice(
        ["0 .. 2", "1 .. 1", "3 .. 1 by -1", "1 .. 0", "[left, right]", "[1, 2]", "0 .. 500", "[]", "1 .. m"]
    )
    return f"{text[:start]} for i in {turns} {{ {''.join(entry)} }}{text[end:]}"


def in_an_edition(rng: random.Random, text: str) -> str:
    """A deck that says its edition, right or wrong; values called as units are, and units that it declares."""
    pieces = pieces_of(text)
    names = re.findall(r"\b(?:let|param)\s+(\w+)", text)
    known = [*units.ALL_UNITS, "ozin", "in", "pi"]
    if names and rng.random() < 0.6:
        old, new = rng.choice(names), rng.choice(known)
        pieces = [new if piece == old else piece for piece in pieces]
    at = [i for i, piece in enumerate(pieces) if piece in units.ALL_UNITS]
    if at and rng.random() < 0.5:
        where = rng.choice(at)
        size = rng.choice(
            [f"2.5 {pieces[where]}", f"(1/3) {pieces[where]}", "1 ozin^2", "0 m", "1e300 km^9", "x", "-1 m"]
        )
        pieces[where] = "ozin"
        pieces.insert(rng.choice([0, len(pieces)]), f"\nunit ozin = {size};\n")
    heading = rng.choice(
        ["deck 2;\n", "deck 2;\n", "deck 2;\n", "// a\ndeck 1;\n", "deck 3;\n", "deck 2\n", "\ndeck 2;"]
    )
    if rng.random() < 0.1:
        return "".join(pieces) + heading
    return heading + "".join(pieces)


def from_a_table(rng: random.Random, text: str) -> str:
    """A value, or those of a link, taken from a table by row name, some rows or columns of which there may not be."""
    spots = list(re.finditer(r"(?<![\w.])(\w+)(\s*=\s*)([^;{}=]*)(?=;)", text))
    if not spots:
        return text
    for spot in sorted(rng.sample(spots, min(len(spots), rng.choice([1, 1, 3]))), key=lambda s: -s.start()):
        row = rng.choice(["bar", "left", "seg_1", "{side}", "seg_{i}", "none", spot[1]])
        column = rng.choice([spot[1], "mass", "com", "inertia", "com.x", "by", "friction"])
        value = rng.choice([f"rows.{row}.{column}", f"2 * rows.{row}.{column}", f"rows.{row}", "rows"])
        text = text[: spot.start(3)] + value + text[spot.end() :]
    table = (
        rng.choice(["let", "let", "param"]) + ' rows = csv("' + rng.choice(["rows.csv", "rows.csv", "x.csv"]) + '");'
    )
    return f"{table}\n{text}" if rng.random() < 0.8 else f"{text}\n{table}\n"


def commanded(rng: random.Random, text: str) -> str:
    """A command that is a pulse of some quantity, and a start that is as it commands."""
    number = partial(rng.choice, ("0.1", "1", "-0.5", "0", "1e-9", "3", "1e300", "0.25"))
    unit = rng.choice(("rad", "rad", "m", "deg", "N*m"))
    pulse = f"pulse(to = {number()} {unit}/s, slope = {number()} {unit}/s^2, over = {number()} s, begin = {number()} s)"
    course = f"{rng.choice(('rate', 'rate', 'position', 'torque'))}({pulse})"
    text = re.sub(r"(?<=command = )[^;{}]*(?=;)", lambda old: course if rng.random() < 0.5 else old[0], text)
    start = rng.choice(("q = command;", "q = command; qd = command;", "* = command;", "q = [command, 0 rad];"))
    runs = list(re.finditer(r"(?:run|sweep) [^;{}]*\{", text))
    if not runs or rng.random() < 0.2:
        return text
    if "initial {" in text and rng.random() < 0.8:
        return text.replace("initial {", f"initial {{ {start}", 1)
    at = rng.choice(runs).end()
    return f"{text[:at]} initial {{ {start} }} {text[at:]}"


def nested(rng: random.Random, text: str) -> str:
    """Something repeated very often, or very deep."""
    spots = [match.start() for match in re.finditer(r"[=;{]", text)] or [0]
    at = rng.choice(spots) + 1
    opening, closing = rng.choice(["()", "[]", "{}", ("a {", "}"), ("-", ""), ("not ", ""), ("f(", ")"), ("a.", "")])
    count = rng.choice([2, 10, 39, 41, 200, 2000])
    made = opening * count + rng.choice(["1", "", "x"]) + closing * rng.choice([count, count - 1, 0])
    return text[:at] + made + text[at:]


def long_line(rng: random.Random, text: str) -> str:
    """A comment, a string, a name or a row of them on one very long line."""
    spots = [match.end() for match in re.finditer(r"[;{}\n]", text)] or [0]
    at, count = rng.choice(spots), rng.choice([200, 5_000, 50_000])
    opening, piece, closing = rng.choice([
        ("// ", "x", "\n"), ("// ", "x ", "\n"), ("/* ", "*", " */"), ("/*", " /*", "*/"), ('"', "x", '"'),
        ('x = "', "x\\", ";\n"), ("let ", "x", " = 1;"), ("x = ", "1", ";"), ("x = [", "1, ", "1];"), ("", "x ", ";"),
        ("", " ", ""), ("#define LONG ", "x ", "\nLONG\n"), ("#if ", "1 + ", "1\n#endif\n"),
        ("", "/**/", ""), ("", "\\\n", ""),
    ])  # fmt: skip
    return text[:at] + opening + piece * (count // len(piece)) + closing + text[at:]


def spliced(rng: random.Random, text: str) -> str:
    """The head of one deck and the tail of another."""
    other = rng.choice(corpus.decks())
    return text[: rng.randrange(len(text) + 1)] + other[rng.randrange(len(other) + 1) :]


def _solid(pieces: Sequence[str]) -> list[int]:
    """Where the pieces are neither blanks nor comments."""
    return [i for i, piece in enumerate(pieces) if piece.strip() and not piece.startswith(("//", "/*"))]


GENTLE: Sequence[Callable[[random.Random, str], str]] = (
    word_of_its_kind, word_of_its_kind, changed_number, changed_entry, other_block, other_block, in_a_loop,
    in_an_edition, from_a_table, commanded,
)  # fmt: skip
_WILD: Sequence[Callable[[random.Random, str], str]] = (
    *GENTLE, changed_word, changed_word, changed_word, through_macro, through_macro, nested, long_line, spliced,
    in_a_loop, in_a_loop,
)  # fmt: skip
