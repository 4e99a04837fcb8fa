"""Random programs of macros whose calls are put off, for comparison with another preprocessor.

A name is kept apart from its parenthesis (`F EMPTY() (x)`), stands at the end of an argument or of a body, or comes
out of another call (`F_() (x)`); so whether a macro is used depends on what is still being read when its call is
complete.
"""

from __future__ import annotations

import random

HEAD = """\
#define EMPTY()
#define NO
#define ID(x) x
#define DEFER(x) x EMPTY()
#define TWICE(x) ID(ID(x))
#define CAT(a, b) a ## b
#define PASTE(a, b) CAT(a, b)
#define STR(x) #x
#define TEXT(x) STR(x)
#define REST(x, ...) __VA_ARGS__
"""
OUTER = ("ID", "ID", "TWICE", "DEFER", "TEXT", "STR")


def program(rng: random.Random) -> str:
    """Two to four macros that use each other, directly and by a later call, and lines that use them."""
    takes = {f"F{letter}": rng.choice([0, 1, 1, 1, 2]) for letter in "ABC"[: rng.randint(1, 3)]}
    plain = [f"P{i}" for i in range(rng.randint(0, 2))]
    made = _Program(rng, takes, plain)
    lines = [HEAD]
    for name, count in takes.items():
        parameters = ["x", "y"][:count]
        lines.append(f"#define {name}({', '.join(parameters)}) {made.body(parameters)}\n")
        lines.append(f"#define {name}_() {name}\n")
    lines += [f"#define {name} {made.body([])}\n" for name in plain]
    lines += [f"{made.pieces(['1', 'z'], 0)} ;\n" for _ in range(rng.randint(1, 3))]
    return "".join(lines)


def optional_program(rng: random.Random) -> str:
    """Macros that take any number of arguments, with `__VA_OPT__`, and lines that use them."""
    lines = [HEAD, "#define E\n"]
    names = [f"V{i}" for i in range(rng.randint(1, 3))]
    words = ("x", "x", "__VA_ARGS__", "__VA_ARGS__", "one", "#x", "#__VA_ARGS__", "a ## x", "E")
    for i, name in enumerate(names):
        known = [*words, *(f"{other}(x, __VA_ARGS__)" for other in names[:i])]
        body = []
        for _ in range(rng.randint(1, 3)):
            inside = " ".join(rng.choice(known) for _ in range(rng.randint(0, 3)))
            forms = ("{}", "{}", "c ## {}", "{} ## d", "# {}", "a ## {} ## b")
            body += [rng.choice(known), rng.choice(forms).format(f"__VA_OPT__({inside})")]
        lines.append(f"#define {name}(x, ...) {' '.join(body)}\n")
    for _ in range(3):
        arguments = [rng.choice(["y", "", "E", "EMPTY()", "z w", "ID(E)"]) for _ in range(rng.randint(1, 3))]
        lines.append(f"{rng.choice(names)}({', '.join(arguments)}) ;\n")
    return "".join(lines)


class _Program:
    def __init__(self, rng: random.Random, takes: dict[str, int], plain: list[str]) -> None:
        self.rng = rng
        self.takes = takes
        self.plain = plain

    def body(self, words: list[str]) -> str:
        rng = self.rng
        if len(words) == 2 and rng.random() < 0.15:
            return f"{words[0]} ## {words[1]} {self.pieces(words, 1)}"
        if words and rng.random() < 0.1:
            return f"#{words[0]} {self.pieces(words, 1)}"
        return self.pieces(words, 1)

    def pieces(self, words: list[str], depth: int) -> str:
        return " ".join(self.piece(words, depth) for _ in range(self.rng.choice([1, 1, 1, 2, 2, 3])))

    def piece(self, words: list[str], depth: int) -> str:
        """A word, a call, or a call that is put off in one of the ways there are."""
        rng = self.rng
        how = rng.random()
        name = rng.choice(list(self.takes))
        if how < 0.25 or depth > 2:
            return rng.choice([*words, *self.plain, "+", name, "NO"])
        if how < 0.4:
            return f"{rng.choice(OUTER)}({self.pieces(words, depth + 1)})"
        if how < 0.46:
            return (
                f"{rng.choice(['CAT', 'PASTE'])}({rng.choice(['FA', 'F', '', name])}, "
                f"{rng.choice(['_', 'A', '', 'A_'])})"
            )
        if how < 0.5:
            return f"REST({self.piece(words, depth + 1)}, {self.pieces(words, depth + 1)})"
        call = f"({', '.join(self.pieces(words, depth + 1) for _ in range(self.takes[name]))})"
        later = (
            f"{name} ",
            f"{name} EMPTY() ",
            f"{name} NO ",
            f"DEFER({name}) ",
            f"{name}_ EMPTY() () ",
            f"{name}_() ",
            f"ID({name}) ",
            f"DEFER({name}_)() ",
            f"{name}_ NO () ",
        )
        return rng.choice(later) + (call if rng.random() < 0.9 else "")
