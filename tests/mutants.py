"""How many small mistakes in a module the tests notice: `python -m tests.mutants MODULE ...`, from the project's root.

A mutant is the module with one small change (a comparison turned, a sign, a constant, a condition, a statement left
out). A seeded sample of them is tried on a copy of the tree, never on the tree itself. Each is given the tests that
execute the changed line, until one fails: those of `scripts/test` before those that CI adds and those before the rest,
and of a tier those of the module's own folder before others, the cheapest first. What survives is printed, and what
only tests outside `scripts/test` notice.

    MODULE            a file, such as met/statistics/confidence.py
    --count N         mutants of each module [20]
    --seed N          of the sample [1]
    --tests WORDS     which tests, as pytest's `-m` [those of `scripts/test`]
    --paths PATH ...  in which folders [tests]
    --cap SECONDS     processor time of tests of a tier for each mutant, after which the next tier's are tried [60]
    -o FILE           write each mutant as a line of JSON: file, line, change, the test that noticed it, or null, and
                      that test's tier (default, ci or release)
    --again FILE      of the sample only what FILE, which an earlier `-o` wrote, says that no test noticed

First all tests are run once on the unchanged tree, to see which lines they execute and what they cost; those that fail
there are left out. Lines that only another process executes are not seen, and a line without a test is printed as that.
What runs when a module is imported belongs to all tests that execute a line of it.
"""

from __future__ import annotations

import argparse
import ast
import copy
import importlib
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
from collections import defaultdict
from collections.abc import Generator, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from tests.costs import tier_of

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
    """All mutants of a module's text, in the order of its lines. Annotations stay, which nothing evaluates."""
    found = []
    nodes = list(ast.walk(ast.parse(text)))
    types = [getattr(node, name, None) for node in nodes for name in ("annotation", "returns")]
    unread = {id(node) for each in types if each is not None for node in ast.walk(each)}
    for index, node in enumerate(nodes):
        for number in range(len(_changes(node)) if id(node) not in unread else 0):
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


def imported_lines(text: str) -> list[int]:
    """The lines of a module's text that no function's body holds: they run when the module is imported."""
    functions = (ast.FunctionDef, ast.AsyncFunctionDef)
    bodies = [node for node in ast.walk(ast.parse(text)) if isinstance(node, functions)]
    inside = {line for node in bodies for line in range(node.body[0].lineno, (node.end_lineno or 0) + 1)}
    return [line for line in range(1, text.count("\n") + 2) if line not in inside]


class Traced:
    """Plugin of pytest: writes which lines of some files each test function executes, and what it costs."""

    def __init__(self, files: list[str], out: Path) -> None:
        self._files = {str(ROOT / file): file for file in files}
        self._lines: dict[str, set[str]] = defaultdict(set)
        self._costs: dict[str, float] = defaultdict(float)
        self._tiers: dict[str, str] = {}
        self._failing: set[str] = set()
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
        self._tiers[function] = tier_of(mark.name for mark in item.iter_markers())
        before = os.times()
        sys.settrace(self._called)
        threading.settrace(self._called)
        try:
            return (yield)
        finally:
            sys.settrace(None)
            threading.settrace(None)  # type: ignore[arg-type]
            after = os.times()
            self._costs[function] += sum(after[:4]) - sum(before[:4])

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self._failing.add(report.nodeid.partition("[")[0])

    def pytest_sessionfinish(self) -> None:
        sound = {function: hit for function, hit in self._lines.items() if function not in self._failing}
        lines = {function: sorted(hit) for function, hit in sound.items() if hit}
        self._out.write_text(json.dumps({"lines": lines, "costs": self._costs, "tiers": self._tiers}))


def pytest_configure(config: pytest.Config) -> None:
    """Start tracing where this file is given to pytest as a plugin."""
    if "MET_MUTANTS_FILES" in os.environ and (os.environ.get("PYTEST_XDIST_WORKER") or not config.option.numprocesses):
        out = Path(os.environ["MET_MUTANTS_OUT"], f"{os.environ.get('PYTEST_XDIST_WORKER', 'main')}.json")
        config.pluginmanager.register(Traced(os.environ["MET_MUTANTS_FILES"].split(":"), out))


def _tests_pass(words: list[str], cap: float) -> bool:
    """Whether pytest passes in a child of this process, which has loaded libraries and nothing of the product; False
    where its processor time is over."""
    child = os.fork()
    if child == 0:
        status = 70
        try:
            resource.setrlimit(resource.RLIMIT_CPU, (int(cap), int(cap) + 5))
            for stream in (1, 2):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream)
            sys.dont_write_bytecode = True  # no other mutant may find this one's
            words = ["-n", "0", "-o", f"faulthandler_timeout={cap}", *words]  # what waits for ever is ended too
            status = int(pytest.main(["-q", "-p", "no:cacheprovider", *words]))
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status) in (0, 5)


@dataclass(frozen=True)
class Known:
    """What a run of the tests on the unchanged tree has shown of the test functions.

    executing  those that execute a line, by `file:line`
    costs      processor seconds of each
    tiers      the tier of each: default, ci or release
    """

    executing: dict[str, list[str]]
    costs: dict[str, float]
    tiers: dict[str, str]

    def groups(self, file: str, line: int) -> Iterator[tuple[str, list[list[str]]]]:
        """Each tier that has functions which execute a line, the quickest tier first, and its functions, so many
        together that pytest's start does not cost most: those of the module's own folder first, the cheapest first."""
        functions = self.executing.get(f"{file}:{line}", [])
        own = f"tests/{Path(file).parent.as_posix()}/"
        for tier in ("default", "ci", "release"):
            groups: list[list[str]] = []
            of_tier = [each for each in functions if self.tiers[each] == tier]
            for function in sorted(of_tier, key=lambda each: (not each.startswith(own), self.costs[each])):
                if not groups or len(groups[-1]) == 100 or sum(self.costs[each] for each in groups[-1]) > 3.0:
                    groups.append([])
                groups[-1].append(function)
            if groups:
                yield tier, groups


def trace(files: list[str], paths: list[str], marks: str) -> Known:
    """Run the tests on the unchanged tree, this one, to know what they execute of some files and what they cost."""
    with tempfile.TemporaryDirectory() as out:
        words = [
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "tests.mutants",
            "-n",
            str(os.cpu_count() or 1),
            "-m",
            marks,
            *paths,
        ]
        known = {"MET_MUTANTS_FILES": ":".join(files), "MET_MUTANTS_OUT": out}
        command = [sys.executable, "-m", "pytest", *words]
        done = subprocess.run(command, env={**os.environ, **known}, capture_output=True, text=True)
        if not any(Path(out).glob("*.json")):
            sys.exit(f"no test ran: {done.stdout}{done.stderr}")
        executing: dict[str, list[str]] = defaultdict(list)
        costs: dict[str, float] = defaultdict(float)
        tiers: dict[str, str] = {}
        for part in Path(out).glob("*.json"):
            table = json.loads(part.read_text())
            for function, lines in table["lines"].items():
                for line in lines:
                    executing[line].append(function)
            for function, seconds in table["costs"].items():
                costs[function] += seconds
            tiers.update(table["tiers"])
        for file in files:
            every = {test for line, tests in executing.items() if line.startswith(f"{file}:") for test in tests}
            for number in imported_lines((ROOT / file).read_text(encoding="utf-8")):
                executing[f"{file}:{number}"] = sorted(every)
        return Known({line: sorted(set(functions)) for line, functions in executing.items()}, dict(costs), tiers)


# trying them


def tried(mutant: Mutant, known: Known, cap: float) -> tuple[str, str] | None:
    """The tier and the name of the cheapest test function that notices a mutant; None where none does within the
    cap."""
    path = ROOT / mutant.file
    unchanged = path.read_bytes()
    path.write_text(mutant.text, encoding="utf-8")
    for compiled in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        compiled.unlink()
    try:
        for tier, groups in known.groups(mutant.file, mutant.line):
            spent = 0.0
            for group in groups:
                if spent > cap:
                    break
                cost = sum(known.costs[each] for each in group)
                # A mutant that never ends is noticed too.
                if not _tests_pass(["-x", *group], 10.0 + 10.0 * cost):
                    return tier, group[0] if len(group) == 1 else f"one of {len(group)}, {group[0]} ... {group[-1]}"
                spent += cost
        return None
    finally:
        path.write_bytes(unchanged)


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=(__doc__ or "").split("\n\n")[1])
    parser.add_argument("modules", nargs="+", metavar="MODULE")
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--tests", default=DEFAULT)
    parser.add_argument("--paths", nargs="+", default=["tests"])
    parser.add_argument("--cap", type=float, default=60.0)
    parser.add_argument("-o", "--output", type=Path)
    parser.add_argument("--again", type=Path)
    asked = parser.parse_args()
    if "MET_MUTANTS_TREE" in os.environ:
        return _in_this_tree(asked)
    with tempfile.TemporaryDirectory(prefix="met-mutants-") as folder:
        tree = Path(folder, "tree")
        shutil.copytree(ROOT, tree, ignore=shutil.ignore_patterns(".git", ".venv", "build"))
        words = [*asked.modules, "--paths", *asked.paths, "--tests", asked.tests]
        words += ["--count", str(asked.count), "--seed", str(asked.seed), "--cap", str(asked.cap)]
        words += ["-o", str(asked.output.resolve())] if asked.output is not None else []
        words += ["--again", str(asked.again.resolve())] if asked.again is not None else []
        known = {"MET_MUTANTS_TREE": str(tree), "PYTHONPATH": str(tree)}
        command = [sys.executable, "-m", "tests.mutants", *words]
        return subprocess.run(command, cwd=tree, env={**os.environ, **known}).returncode


def _in_this_tree(asked: argparse.Namespace) -> int:
    """Try mutants in this tree, which is a copy."""
    known = trace(asked.modules, asked.paths, asked.tests)
    seconds = sum(known.costs.values())
    print(f"{len(known.costs)} test functions, {seconds:.0f} s of processor time while traced", flush=True)
    for library in ("numpy", "scipy.linalg", "scipy.optimize", "h5py", "llvmlite.binding", "click"):
        importlib.import_module(library)  # once for all children
    sound = sorted({name for names in known.executing.values() for name in names}, key=known.costs.__getitem__)
    if sound and not _tests_pass(sound[:1], 60.0):
        sys.exit(f"{sound[0]} fails without a mutant, in a child of this process")
    counts: dict[str, int] = defaultdict(int)
    earlier = [json.loads(line) for line in asked.again.read_text("utf-8").splitlines()] if asked.again else []
    unnoticed = {(each["file"], each["line"], each["change"]) for each in earlier if each["test"] is None}
    for file in asked.modules:
        every = mutants(file, (ROOT / file).read_text(encoding="utf-8"))
        sample = random.Random(f"{asked.seed}/{file}").sample(every, min(asked.count, len(every)))
        for mutant in sorted(sample, key=lambda each: each.line):
            if asked.again and (mutant.file, mutant.line, mutant.change) not in unnoticed:
                continue
            tier, test = tried(mutant, known, asked.cap) or (None, None)
            executed = f"{file}:{mutant.line}" in known.executing
            how = f"noticed by {tier}" if tier else "survived" if executed else "no test"
            counts[how] += 1
            if tier != "default":
                print(f"{how:18} {file}:{mutant.line}: {mutant.change} {test or ''}".rstrip(), flush=True)
            if asked.output is not None:
                entry = {"file": file, "line": mutant.line, "change": mutant.change, "test": test, "tier": tier}
                with asked.output.open("a", encoding="utf-8") as out:
                    out.write(json.dumps(entry) + "\n")
    print(", ".join(f"{number} {how}" for how, number in sorted(counts.items())))
    return 0


if __name__ == "__main__":
    sys.exit(main())
