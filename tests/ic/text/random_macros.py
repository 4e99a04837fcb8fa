"""Random programs of macros, for comparison with another preprocessor."""

from __future__ import annotations

import random

WORDS = ("x", "yy", "7", "1.5", "+", "-", "(x)", '"q"')


def program(rng: random.Random, count: int, circles: bool) -> str:
    """Definitions of `count` macros and lines that use them.

    circles: macros may use each other in any way; else each uses only those before it. What a use in a circle becomes
    is not all said by C, so that such programs are kept plain and small.
    """
    return _Program(rng, count, circles).text()


class _Program:
    def __init__(self, rng: random.Random, count: int, circles: bool) -> None:
        self.rng = rng
        self.circles = circles
        self.takes = {f"M{i}": rng.randint(0, 2) for i in range(count)}
        self.rest = {name: not circles and rng.random() < 0.3 for name in self.takes}

    def text(self) -> str:
        rng, names = self.rng, list(self.takes)
        lines = []
        for i, name in enumerate(names):
            lines += self.definition(name, names if self.circles else names[:i])
            if not self.circles and rng.random() < 0.1:
                lines.append(f"#undef {rng.choice(names)}")
        for _ in range(rng.randint(1, 3)):
            line = " ".join(self.piece([*names, "z", *WORDS], names, 0) for _ in range(3))
            lines += self.choice(line) if not self.circles and rng.random() < 0.3 else [line + ";"]
        return "\n".join(lines) + "\n"

    def definition(self, name: str, known: list[str]) -> list[str]:
        rng = self.rng
        parameters = ["p", "q"][: self.takes[name]]
        words = [*known, *parameters, *parameters, "x", *(() if self.circles else ("+", "1", "r_"))]
        head = [*parameters, *(["..."] if self.rest[name] else [])]
        last = ["__VA_ARGS__"] if self.rest[name] else []
        body: list[str] = []
        for _ in range(rng.randint(0, 3)):
            body.append(self.piece([*words, *last, *last], known, 0))
            how = rng.random()
            if self.circles or not (parameters or last):
                continue
            if how < 0.15:
                body.append(f"#{rng.choice(parameters + last)}")
            elif how < 0.3:
                body.append(f"{rng.choice([*parameters, 'x', 'r_'])} ## {rng.choice(parameters + last)}")
            elif how < 0.4 and last:
                body.append(", ## __VA_ARGS__")
        split = " \\\n  " if rng.random() < 0.1 else " "
        return [f"#define {name}{'(' + ', '.join(head) + ')' if head else ''} {split.join(body)}".rstrip()]

    def piece(self, words: list[str], callable_: list[str], depth: int) -> str:
        """A word, or a call of a macro with pieces for arguments."""
        rng = self.rng
        if rng.random() < 0.5 or depth > 1 or not callable_:
            return rng.choice(words)
        name = rng.choice(callable_)
        count = self.takes[name] + (rng.randint(0, 2) if self.rest[name] else 0)
        arguments = [self.piece(words, callable_, depth + 1) if rng.random() < 0.9 else "" for _ in range(count)]
        return f"{name}{rng.choice(['', ' ', '', '/**/'])}({rng.choice([', ', ',']).join(arguments)})"

    def choice(self, line: str) -> list[str]:
        """The line behind a condition of random numbers."""
        rng = self.rng
        name = rng.choice(list(self.takes))
        number = ("0", "1", "7", "-3", "2u", "0x10", name, f"defined({name})")
        terms = [rng.choice(number)]
        for _ in range(rng.randint(0, 4)):
            operator = rng.choice(["+", "-", "*", "<", ">=", "==", "&&", "||", "&", "|", "^", "? 3 :"])
            terms += [operator, rng.choice(["", "!", "~", "- "]) + rng.choice(number)]
        return [f"#if {' '.join(terms)}", line, "#else", "otherwise", "#endif"]
