"""How many small mistakes in a module the tests notice: `python -m tests.mutants MODULE ...`, from the project's root.

A mutant is the module with one small change (a comparison turned, a sign, a constant, a condition, a statement left
out). A seeded sample of them is tried on a copy of the tree, never on the tree itself. Each is given the tests that
execute the changed line, the cheapest first, until one fails. What survives is printed: a line that can be wrong
without a test that says so.

    MODULE            a file, such as met/statistics/confidence.py
    --count N         mutants of each module [20]
    --seed N          of the sample [1]
    --tests WORDS     which tests, as pytest's `-m` [those of `scripts/test`]
    --paths PATH ...  in which folders [tests]
    --cap SECONDS     processor time of tests for each mutant, after which it counts as survived [60]
    -o FILE           write each mutant as a line of JSON: file, line, change, and the test that killed it, or null

First all tests are run once on the unchanged tree, to see which lines they execute and what they cost. Lines that only
another process executes are not seen, and a line without a test is printed as that.
"""

from __future__ import annotations

import argparse
import ast
import copy
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
DEFAULT = "not (slow or release or alone or oracle or compiler or firmware or cluster or browser or node)"
COMPARISONS: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Is: ast.IsNot, ast.IsNot: ast.Is,
}  # fmt: skip
OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult, ast.Pow: ast.Mult, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd,
}  # fmt: skip


@dataclass(frozen=True)
class Mutant:
    """A changed module: the file within the tree, the line, what was changed into what, the whole changed text."""

    file: str
    line: int
    change: str
    text: str


# mutants of a module


def mutants(file: str, text: str) -> list[Mutant]:
    """All mutants of a module's text, in the order of its lines."""
    found = []
    for index, node in enumerate(ast.walk(ast.parse(text))):
        for number in range(len(_changes(node))):
            tree = ast.parse(text)
            changed = list(ast.walk(tree))[index]
            before = ast.unparse(changed)
            _changes(changed)[number]()
            after = ast.unparse(changed)
            line = getattr(changed, "lineno")  # noqa: B009 - every node that has changes has a line
            found.append(Mutant(file, line, f"{_short(before)} -> {_short(after)}", ast.unparse(tree)))
    return sorted(found, key=lambda each: (each.line, each.change))


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= 70 else f"{line[:67]}..."


def _changes(node: ast.AST) -> list[Any]:
    """The ways of changing a node in place, as functions."""

    def setting(name: str, value: Any) -> Any:
        return lambda: setattr(node, name, value)

    match node:
        case ast.Compare(ops=[op, *_]) if type(op) in COMPARISONS:
            return [setting("ops", [COMPARISONS[type(op)](), *node.ops[1:]])]
        case ast.BinOp(op=op, left=left, right=right) if type(op) in OPERATORS:
            words = any(isinstance(each, ast.JoinedStr | ast.Constant) and _is_text(each) for each in (left, right))
            return [] if words else [setting("op", OPERATORS[type(op)]())]
        case ast.BoolOp(op=ast.And()):
            return [setting("op", ast.Or())]
        case ast.BoolOp(op=ast.Or()):
            return [setting("op", ast.And())]
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            return [lambda: _become(node, operand)]
        case ast.Constant(value=bool() as value):
            return [setting("value", not value)]
        case ast.Constant(value=int() | float() as value):
            return [setting("value", value + 1)]
        case ast.If() | ast.IfExp():
            return [setting("test", ast.Constant(True)), setting("test", ast.Constant(False))]
        case ast.Expr(value=ast.Call()) | ast.AugAssign():
            return [lambda: _become(node, ast.Pass())]
        case ast.Return(value=value) if value is not None and not isinstance(value, ast.Constant):
            return [setting("value", ast.Constant(None))]
        case _:
            return []


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str | bytes))


def _become(node: ast.AST, other: ast.AST) -> None:
    """Make a node another one, where it stands."""
    other = copy.deepcopy(other)
    node.__class__ = other.__class__
    place = {name: getattr(node, name) for name in ("lineno", "col_offset", "end_lineno", "end_col_offset")}
    node.__dict__.clear()
    node.__dict__.update({**other.__dict__, **place})


# which tests execute which lines


class Traced:
    """Plugin of pytest: writes which lines of some files each test function executes, and what it costs."""

    def __init__(self, files: list[str], out: Path) -> None:
        self._files = {str(ROOT_OF_RUN / file): file for file in files}
        self._lines: dict[str, set[str]] = defaultdict(set)
        self._costs: dict[str, float] = defaultdict(float)
        self._out = out
        self._hit: set[str] = set()

    def _called(self, frame: FrameType, event: str, _: Any) -> Any:
        name = self._files.get(frame.f_code.co_filename)
        if name is None:
            return None

        def line(frame: FrameType, event: str, _: Any) -> Any:
            self._hit.add(f"{name}:{frame.f_lineno}")
            return line

        return line(frame, event, None)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Generator[None, object, object]:
        function = item.nodeid.partition("[")[0]
        self._hit = self._lines[function]
        before = os.times()
        sys.settrace(self._called)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            after = os.times()
            self._costs[function] += sum(after[:4]) - sum(before[:4])

    def pytest_sessionfinish(self) -> None:
        lines = {function: sorted(hit) for function, hit in self._lines.items() if hit}
        self._out.write_text(json.dumps({"lines": lines, "costs": self._costs}))


ROOT_OF_RUN = Path(os.environ.get("MET_MUTANTS_ROOT", ROOT))


def pytest_configure(config: pytest.Config) -> None:
    """Start tracing where this file is given to pytest as a plugin."""
    if "MET_MUTANTS_FILES" in os.environ and (os.environ.get("PYTEST_XDIST_WORKER") or not config.option.numprocesses):
        out = Path(os.environ["MET_MUTANTS_OUT"], f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.json")
        config.pluginmanager.register(Traced(os.environ["MET_MUTANTS_FILES"].split(":"), out))


def _pytest(tree: Path, words: list[str], surroundings: dict[str, str], cap: float | None = None) -> int:
    """Run pytest on a tree; its exit status, or -9 where its processor time was over."""

    def limited() -> None:
        if cap is not None:
            resource.setrlimit(resource.RLIMIT_CPU, (int(cap), int(cap) + 5))

    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words]
    environment = {**os.environ, "PYTHONPATH": str(tree), "PYTHONDONTWRITEBYTECODE": "1", **surroundings}
    quiet = subprocess.DEVNULL
    return subprocess.run(command, cwd=tree, env=environment, stdout=quiet, stderr=quiet, preexec_fn=limited).returncode


def trace(tree: Path, files: list[str], paths: list[str], marks: str) -> tuple[dict[str, list[str]], dict[str, float]]:
    """The test functions that execute each line, by `file:line`, and the processor seconds of each function."""
    with tempfile.TemporaryDirectory() as out:
        words = ["-p", "tests.mutants", "-n", str(os.cpu_count() or 1), "-m", marks, *paths]
        known = {"MET_MUTANTS_FILES": ":".join(files), "MET_MUTANTS_OUT": out, "MET_MUTANTS_ROOT": str(tree)}
        _pytest(tree, words, known)
        executing, costs = defaultdict(set), defaultdict(float)
        for part in Path(out).glob("*.json"):
            table = json.loads(part.read_text())
            for function, lines in table["lines"].items():
                for line in lines:
                    executing[line].add(function)
            for function, seconds in table["costs"].items():
                costs[function] += seconds
    return {line: sorted(names, key=lambda each: costs[each]) for line, names in executing.items()}, dict(costs)


# trying them


def tried(tree: Path, mutant: Mutant, functions: list[str], costs: dict[str, float], cap: float) -> str | None:
    """The cheapest of the test functions that notices a mutant; None where none does within the cap."""
    path = tree / mutant.file
    kept = path.read_bytes()
    path.write_text(mutant.text, encoding="utf-8")
    try:
        spent = 0.0
        for group in _groups(functions, costs):
            if spent > cap:
                return None
            seconds = 10.0 + 10.0 * sum(costs[each] for each in group)  # a mutant that never ends is noticed too
            if _pytest(tree, ["-x", *group], {}, seconds) not in (0, 5):
                return group[0] if len(group) == 1 else f"one of {len(group)}, {group[0]} ... {group[-1]}"
            spent += sum(costs[each] for each in group)
        return None
    finally:
        path.write_bytes(kept)


def _groups(functions: list[str], costs: dict[str, float]) -> Iterator[list[str]]:
    """Functions in the order of their costs, so many together that pytest's start does not cost most."""
    group: list[str] = []
    for function in functions:
        group.append(function)
        if sum(costs[each] for each in group) > 3.0 or len(group) == 100:
            yield group
            group = []
    if group:
        yield group


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("modules", nargs="+", metavar="MODULE")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", default=DEFAULT)
    parser.add_argument("--paths", nargs="+", default=["tests"])
    parser.add_argument("--cap", type=float, default=60.0)
    parser.add_argument("-o", "--output", type=Path)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="met-mutants-") as folder:
        tree = Path(folder, "tree")
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "build", "__pycache__"))
        executing, costs = trace(tree, asked.modules, asked.paths, asked.tests)
        print(f"{len(costs)} test functions, {sum(costs.values()):.0f} s of processor time while traced", flush=True)
        counts = defaultdict(int)
        for file in asked.modules:
            every = mutants(file, (ROOT / file).read_text(encoding="utf-8"))
            sample = random.Random(f"{asked.seed}/{file}").sample(every, min(asked.count, len(every)))
            for mutant in sorted(sample, key=lambda each: each.line):
                functions = executing.get(f"{file}:{mutant.line}", [])
                killer = tried(tree, mutant, functions, costs, asked.cap)
                how = "killed" if killer else "survived" if functions else "no test"
                counts[how] += 1
                if killer is None:
                    print(f"{how:9} {file}:{mutant.line}: {mutant.change}", flush=True)
                if asked.output is not None:
                    entry = {"file": file, "line": mutant.line, "change": mutant.change, "killer": killer, "how": how}
                    with asked.output.open("a", encoding="utf-8") as out:
                        out.write(json.dumps(entry) + "\n")
        print(", ".join(f"{number} {how}" for how, number in sorted(counts.items())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
