"""Random sweeps over the decks that come with MET: of every kind of axis, sound ones and ones that are a little wrong.

Every number of a run may vary, by its own path or by that of a definition; so may words, rates and models. A sweep is
compiled, printed, explained and written as a plan. `python -m tests.ic.fuzz.sweeps SEED COUNT` tries many.
"""

from __future__ import annotations

import math
import random
import sys
import tempfile
from collections.abc import Sequence
from functools import cache
from itertools import islice
from pathlib import Path

import ic
from ic.driver.compile import Compiled
from ic.find import standard_decks
from ic.printing.explain import print_explained
from ic.sweeps.choices import OF_RUN
from met.diagnostic import Problem
from met.plan import Formula
from tests.ic.fuzz import one

DISTRIBUTIONS = ("uniform", "loguniform", "normal", "truncated")
CHOICES = {
    "integrator": ("rk4", "midpoint", "modified_euler", "semi_implicit_euler"),
    "rates.dynamics": ("1 kHz", "2 kHz", "4 kHz"),
    "environment.velocity_products": ("on", "off"),
    "initial.servos": ("unloaded", "balanced"),
    "duration": ("0.5 s", "1 s"),
}


@cache
def runs(decks: tuple[str, ...]) -> tuple[tuple[str, str, tuple[tuple[str, float, str], ...], str], ...]:
    """Every run of the decks: deck, name, numbers as (path, value, unit), and the structure's servo definitions."""
    found = []
    for deck in decks:
        compiled = ic.check(deck, select="all")
        if compiled.plan is None:
            continue
        for experiment in compiled.plan.experiments:
            if experiment.cases.coordinates or experiment.cases.choices:
                continue
            numbers = [
                (path, float(each.value), each.unit)
                for path, each in experiment.parameters.items()
                if isinstance(each.value, (float, int))
            ]
            numbers += [
                (path, 1.0, each.unit)
                for path, each in experiment.parameters.items()
                if isinstance(each.value, Formula)
            ]
            numbers += [
                (f"{use.definition}.{path.removeprefix(f'{use.joint}.servo.')}", value, unit)
                for use in experiment.structure.servos
                for path, value, unit in tuple(numbers)
                if path.startswith(f"{use.joint}.servo.")
            ]
            words = sorted({use.definition for use in experiment.structure.servos})
            found.append((deck, experiment.name, tuple(numbers), ",".join(words)))
    return tuple(found)


class Writer:
    """One deck with a few sweeps; `rough` is how often something is wrong with an entry."""

    def __init__(self, rng: random.Random, folder: Path, rough: float, decks: tuple[str, ...]) -> None:
        self.rng, self.folder, self.rough = rng, folder, rough
        self.deck, self.run, self.numbers, servos = rng.choice(runs(decks))
        self.servos = servos.split(",")
        self.used: list[str] = []
        self.names: tuple[str, ...] = ()
        self.options: list[str] = []

    def text(self) -> str:
        """The deck: sweeps, and sometimes their sum; or none, and `options` of a command line that vary its run."""
        if self.rng.random() < 0.2:
            axes = [self.rng.choice((self.vary, self.vary, self.choice))() for _ in range(self.rng.choice((1, 1, 2)))]
            self.names, self.options = (self.run,), [each.removeprefix("vary ").rstrip(";") for each in axes]
            return f"#include <{self.deck}>\n"
        count = self.rng.choice((1, 1, 2))
        self.names = ("s0",) if count == 1 else ("both",)
        sweeps = [self.sweep(f"s{n}") for n in range(count)]
        if count > 1:
            sweeps.append("sweep both = s0 + s1;")
        return "\n".join([f"#include <{self.deck}>", *sweeps, ""])

    def sweep(self, name: str) -> str:
        axes = [self.axis() for _ in range(self.rng.choice((1, 1, 1, 2, 3)))]
        if self.rng.random() < 0.05:
            axes.append(f"repeat {self.rng.choice((2, 3))};")
        if self.rng.random() < 0.2:
            axes.append(f"seed = {self.rng.randrange(9)};")
        if self.rng.random() < 0.03:
            axes.append("seeds = independent;")
        if self.rng.random() < 0.1:
            path, value, unit = self.number()
            axes.append(f"exclude when {path} {self.rng.choice(('<', '>', '==', '!='))} {self.one(value, unit)};")
        return f"sweep {name} of {self.run} {{\n    " + "\n    ".join(axes) + "\n}"

    def axis(self) -> str:
        kinds = (self.vary,) * 4 + (self.choice, self.zip, self.file, self.sample, self.vector)
        return self.rng.choice(kinds)()

    def number(self) -> tuple[str, float, str]:
        path, value, unit = self.rng.choice(self.numbers)
        while not self.rough and (path in self.used or not value or not math.isfinite(value) or ".inertia." in path):
            path, value, unit = self.rng.choice(self.numbers)
        if self.rng.random() < self.rough:
            path = path.rpartition(".")[0] or path
        if self.rng.random() < self.rough:
            unit = self.rng.choice(("m", "1", "rad", "Hz", "N*m", unit))
        self.used.append(path)
        return path, value, unit

    def size(self, value: float) -> float:
        """A number near the run's own, or one that is not."""
        if self.rng.random() < self.rough:
            return self.rng.choice((0.0, -value, value * 1e300, 1e-320, -1e305, value))
        return float(f"{value * self.rng.uniform(0.99, 1.01):.9g}") if value else self.rng.choice((0.0, 1e-3))

    def one(self, value: float, unit: str) -> str:
        return f"({self.size(value)!r}) {self.written(unit)}"

    def written(self, unit: str) -> str:
        return "" if unit in ("1", "") else f"{unit[2:]}^-1" if unit.startswith("1/") and unit[2:].isalpha() else unit

    def values(self, value: float, unit: str, count: int) -> str:
        kind = self.rng.randrange(7)
        low, high = sorted((self.size(value), self.size(value)))
        if kind == 0 and count > 1:
            return f"linspace({low!r}, {high!r}, {count}) {self.written(unit)}"
        if kind == 1 and count > 1:
            return f"logspace({low!r}, {high!r}, {count}) {self.written(unit)}"
        if kind == 2 and count > 1:
            return f"({low!r} .. {low!r} + {count - 1} by 1) {self.written(unit)}"
        if kind == 3 and count > 1:
            return f"{low!r} .. {low!r} + {count - 1} by 1 {self.written(unit)}"
        return f"[{', '.join(repr(self.size(value)) for _ in range(count))}] {self.written(unit)}"

    def vary(self) -> str:
        path, value, unit = self.number()
        return f"vary {path} = {self.values(value, unit, self.rng.choice((1, 1, 2, 3)))};"

    def vector(self) -> str:
        """All that stands beside one number: the parts of a vector, say."""
        head = self.rng.choice(self.numbers)[0].rpartition(".")[0]
        parts = [each for each in self.numbers if each[0].rpartition(".")[0] == head and math.isfinite(each[1])][:6]
        self.used += [each[0] for each in parts]
        count = self.rng.choice((1, 2))
        inside = " ".join(f"{path} = {self.values(value, unit, count)};" for path, value, unit in parts)
        return f"zip {{ {inside} }}"

    def choice(self) -> str:
        kind = self.rng.randrange(8)
        if kind == 0:
            joints = [path.partition(".")[0] for path, _, _ in self.numbers if ".servo." in path]
            joint = self.rng.choice(joints or ["none"])
            return f"vary {joint}.servo = [{', '.join(self.rng.sample(self.servos, min(2, len(self.servos))))}];"
        if kind == 1:
            return "vary macro FAST = [0, 1];"
        path, options = self.rng.choice(list(CHOICES.items()))
        if path in OF_RUN and self.rng.random() < self.rough:
            return f"vary {path} = [];"
        return f"vary {path} = [{', '.join(self.rng.sample(options, self.rng.choice((1, 2))))}];"

    def zip(self) -> str:
        count = self.rng.choice((1, 2, 3))
        inside = []
        for _ in range(self.rng.choice((1, 2, 3))):
            path, value, unit = self.number()
            inside.append(f"{path} = {self.values(value, unit, count + (self.rng.random() < self.rough))};")
        return f"zip {{ {' '.join(inside)} }}"

    def file(self) -> str:
        columns = [self.number() for _ in range(self.rng.choice((1, 2)))]
        heads = [path if unit in ("1", "") else f"{path} [{unit}]" for path, _, unit in columns]
        rows = [",".join(repr(self.size(value)) for _, value, _ in columns) for _ in range(self.rng.choice((1, 1, 3)))]
        name = f"cases{len(self.used)}.csv"
        (self.folder / name).write_text("\n".join([",".join(heads), *rows, ""]), encoding="utf-8")
        return f'from "{name}";'

    def sample(self) -> str:
        inside = []
        for _ in range(self.rng.choice((1, 2))):
            path, value, unit = self.number()
            low, high = sorted((self.size(value), self.size(value) + abs(value) * 0.01))
            kind = self.rng.choice(DISTRIBUTIONS)
            arguments = {"normal": (value, abs(value) * 0.01), "truncated": (value, abs(value) * 0.1, low, high)}
            numbers = ", ".join(map(repr, arguments.get(kind, (low, high))))
            inside.append(f"{path} = {kind}({numbers}) {self.written(unit)};")
        design = self.rng.choice(("random", "lhs", "sobol"))
        return f"sample {design}({self.rng.choice((1, 1, 2, 5))}) {{ {' '.join(inside)} }}"


def fault_of(
    seed: str, folder: Path, rough: float, decks: tuple[str, ...] = tuple(standard_decks())
) -> tuple[str, str, bool]:
    """The deck of this seed, what is wrong with MET as it shows it ("" for nothing), and whether it compiles."""
    writer = Writer(random.Random(seed), folder, rough, decks)
    path = folder / "deck.ic"
    path.write_text(writer.text(), encoding="utf-8")
    compiled = []

    def also(made: Compiled) -> None:
        compiled.append(made)
        _explained(made, writer.used)

    found = one.fault_of(path, writer.names, also, writer.options)
    varied = "".join(f"// --vary {each!r}\n" for each in writer.options)
    return varied + path.read_text(encoding="utf-8"), "" if found is None else "\n".join(found), bool(compiled)


def _explained(compiled: Compiled, paths: Sequence[str]) -> None:
    for path in paths[:2]:
        try:
            for _ in islice(print_explained([lambda: (compiled.plan, compiled)], path), one.MOST_LINES):
                pass
        except Problem:
            continue


def main(seed: str, count: int, folder: Path) -> int:
    """Tries so many; prints what faults there are, and how many decks compiled."""
    sound, faults = 0, 0
    for n in range(count):
        text, fault, compiled = fault_of(f"{seed}/{n}", folder, rough=0.0 if n % 3 else 0.1)
        sound += compiled
        if fault:
            faults += 1
            print(f"{seed}/{n}\n{text}\n{fault}\n")
    print(f"{count} decks, {sound} compile, {faults} show a fault of MET")
    return 1 if faults else 0


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        sys.exit(main(sys.argv[1], int(sys.argv[2]), Path(made)))
