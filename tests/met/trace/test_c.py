"""A program in C: the kernel's bits, whatever compiles it, at any level, with the processor's fma or without."""

from __future__ import annotations

import math
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import ic
from met.backends.c.emit import emit, literal
from met.backends.llvm import kernel
from met.program import build
from met.run import inputs
from met.trace import (
    Graph,
    Mask,
    Scalar,
    acos,
    asin,
    atan,
    atan2,
    both,
    clip,
    cos,
    either,
    exp,
    floor,
    fma,
    gather,
    is_nan,
    log,
    maximum,
    minimum,
    not_,
    rint,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from met.trace.functions import philox
from met.trace.nodes import evaluate
from met.trace.noise import Stream, normal_pair
from met.trace.program import Every, Phase, Program, RecordPhase, RunPhase, Tape, Unless0, WhileAny
from met.trace.recorder import record
from tests.met.trace.compiled import STRICT, different, driver, need, run

HERE = [("gcc", "-O0"), ("gcc", "-O3"), ("gcc", "-O2", "-mfma"), ("clang", "-O2"), ("clang", "-O1", "-mfma")]
ALL = [
    (name, level, *more)
    for name in ("gcc", "clang")
    for level in ("-O0", "-O1", "-O2", "-O3")
    for more in ((), ("-mfma",))
]
ARM = [("arm-none-eabi-gcc", level) for level in ("-O0", "-Os", "-O1", "-O2", "-O3")]

SPECIAL = np.array([
    0.0, 5e-324, 1e-310, 2.2250738585072014e-308, 2.225073858507201e-308, 1e-200, 2.0**-53, 0.25, 0.5, 1.0,
    1.0 + 2.0**-52, 1.5, 2.0, 2.5, 3.0, math.pi, 1e9, 2.0**31, 2.0**32, 2.0**52 - 0.5, 2.0**52, 2.0**53 - 1.0, 2.0**53,
    2.0**62, 2.0**63, 1e200, 8.98846567431158e307, 1.7976931348623157e308, math.inf, math.nan,
])  # fmt: skip


def three(count: int, seed: int) -> np.ndarray:
    """Operands [case, 3]: every pair of special numbers with a third, random patterns, and what is hard to round."""
    rng = np.random.default_rng(seed)
    special = np.concatenate([SPECIAL, -SPECIAL])
    pairs = np.array([(a, b) for a in special for b in special])
    ends = np.column_stack([pairs, rng.choice(special, len(pairs))])
    patterns = rng.integers(0, 2**64, (count, 3), dtype=np.uint64).view(np.float64)
    near = rng.standard_normal((count, 3)) * 10.0 ** rng.uniform(-3, 3, (count, 3))
    with np.errstate(all="ignore"):
        # c nearly -a*b: at all distances; products at the lower end; ties
        cancel = rng.standard_normal((count, 3))
        cancel[:, 2] = -cancel[:, 0] * cancel[:, 1] * (1.0 + 2.0 ** -rng.integers(0, 60, count).astype(float))
        small = np.ldexp(rng.standard_normal((count, 3)), rng.integers(-560, -500, (count, 3)))
        small[:, 2] = np.ldexp(rng.standard_normal(count), rng.integers(-1080, -1000, count))
        large = np.ldexp(rng.standard_normal((count, 3)), rng.integers(500, 514, (count, 3)))
        large[:, 2] = np.ldexp(rng.standard_normal(count), rng.integers(1010, 1026, count))
        ties = np.ldexp(np.rint(rng.standard_normal((count, 3)) * 2.0**26), rng.integers(-60, 60, (count, 3)))
        halves = np.rint(rng.standard_normal((count, 3)) * 8.0) / 2.0
    # exponents far apart, the greater number just above a power of two: libgcc's sum for ARM is wrong at 33
    apart = rng.uniform(1.0, 2.0, (count, 3)) * 2.0 ** -rng.integers(30, 36, (count, 3)).astype(float)
    apart[:, 0] = rng.choice([1.0, 1.0 + 2.0**-52, 2.0], count)
    apart *= rng.choice([1.0, -1.0], (count, 3))
    return np.concatenate([ends, patterns, near, cancel, small, large, ties, halves, apart])


def operations(a: Scalar, b: Scalar, c: Scalar) -> list[Scalar]:
    """Each operation of a graph at least once, also on turned signs and on what is known while it is recorded."""
    graph = a.graph
    return [
        a + b,
        a - b,
        a * b,
        a / b,
        abs(a),
        -a,
        sqrt(a),
        sqrt(abs(b)),
        floor(a),
        rint(a),
        fma(a, b, c),
        fma(a, -b, c),
        fma(a, b, -c),
        a * b + c,
        c - a * b,
        1.0 / a,
        a / 3.0,
        math.inf - a,
        a * math.nan,
        *(Scalar(graph, graph.unary(op, a.ref)) for op in ("pow2", "exponent", "significand")),
        *(where(Mask(graph, graph.bit(a.ref, n)), b, c) for n in (0, 1, 51, 52, 62, 63)),
        *(Scalar(graph, graph.flip(a.ref, b.ref, n)) for n in (0, 17, 52, 63)),
        where(a < b, a, c),
        where(a <= b, a, c),
        where(a == b, a, c),
        where(a != b, -a, c),
        where(both(a < b, not_(b < c)), a, b),
        where(either(a < b, is_nan(c)), 1.0, -0.0),
        minimum(a, b),
        maximum(a, b),
        clip(a, -1.0, 2.0),
        gather((0.5, -1.0, math.inf, 1e300, math.nan), a),
        *(philox(floor(abs(a)), floor(abs(b)), 3.0, c, 0.0, 4294967295.0, word) for word in range(4)),
    ]


def elementary(a: Scalar, b: Scalar, c: Scalar) -> list[Scalar]:
    """What models call, and noise."""
    unit = a / (1.0 + abs(a))
    noise = normal_pair(Stream(floor(abs(b)), 3.0, "shoulder.bed.tachometer"), floor(abs(c)))
    return [
        sin(a),
        cos(b),
        tan(c),
        exp(a),
        exp(b * 0.01),
        log(abs(a)),
        log(b),
        tanh(a),
        asin(unit),
        acos(unit),
        atan(c),
        atan2(a, b),
        *noise,
    ]


def table(make: Callable[[Scalar, Scalar, Scalar], list[Scalar]]) -> Program:
    """A program that records all of these of its inputs a, b and c."""
    graph = Graph()
    count = len(make(*(graph.input(name) for name in "abc")))

    def row(t: Tape) -> None:
        for column, value in enumerate(make(*(t.input(name) for name in "abc"))):
            t.record(column, value)

    def end(t: Tape) -> None:
        t.output("c", t.input("c"))

    return Program(
        7.0, (), (RecordPhase(Phase("row", row), 1),), (RunPhase(Phase("end", end)),), ("a", "b", "c"), count, ("c",)
    )


def meant(program: Program, cases: np.ndarray) -> np.ndarray:
    """The row of each case by the definitions of met/trace/primitives.py, [case, column]."""
    section = record(program).sections[0]
    with np.errstate(all="ignore"):
        values = evaluate(section.nodes, section.order, lambda node: cases[:, "abc".index(node[1])], arrays=True)
    rows = np.empty((len(cases), program.columns))
    for column, ref in section.records:
        rows[:, column] = -values[ref >> 1] if ref & 1 else values[ref >> 1]
    return rows


def same(program: Program, cases: np.ndarray, folder: Path, words: tuple[str, ...], ticks: int = 0) -> None:
    """Asserts that rows and outputs in C are the kernel's."""
    rows, outputs = run(program, cases, ticks, folder, words)
    expected = kernel.compile(program).run(cases, ticks)
    assert expected[0] is not None
    assert different(expected[0], rows) == 0
    assert different(expected[1], outputs) == 0


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize("words", HERE, ids=" ".join)
def test_every_operation_has_the_bits_of_kernel_and_definition(tmp_path: Path, words: tuple[str, ...]) -> None:
    program, cases = table(operations), three(4000, 1)
    same(program, cases, tmp_path, words)
    rows = kernel.compile(program).run(cases, 0)[0]
    assert rows is not None
    assert different(rows[:, 0].copy(), meant(program, cases)) == 0


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize("words", HERE, ids=" ".join)
def test_elementary_functions_and_noise_have_the_kernels_bits(tmp_path: Path, words: tuple[str, ...]) -> None:
    same(table(elementary), three(2000, 2), tmp_path, words)


@pytest.mark.release
@pytest.mark.parametrize("make", [operations, elementary])
@pytest.mark.parametrize("words", [*ALL, *ARM], ids=" ".join)
def test_every_compiler_and_level_gives_the_same_bits(
    tmp_path: Path, words: tuple[str, ...], make: Callable[[Scalar, Scalar, Scalar], list[Scalar]]
) -> None:
    same(table(make), three(4000, 3), tmp_path, words)


@pytest.mark.compiler
@pytest.mark.parametrize("words", HERE[1:3], ids=" ".join)
def test_a_whole_run_with_friction_has_the_kernels_bits(tmp_path: Path, words: tuple[str, ...]) -> None:
    experiment = ic.compile("two_link.ic", select=["gains"]).experiments[0]
    same(build(experiment), inputs(experiment, np.arange(5)), tmp_path, words, experiment.structure.schedule.ticks)


@pytest.mark.compiler
def test_control_and_memory_are_the_programs(tmp_path: Path) -> None:
    def count(t: Tape) -> None:
        t.write("n", t.read("n") + 1.0)

    def begin(t: Tape) -> None:
        t.write("left", t.input("x"))
        t.write("swapped", 2.0)

    def turn(t: Tape) -> None:
        t.write("left", t.read("left") - 1.0)
        t.write("turns", t.read("turns") + t.read("n"))
        t.write("swapped", t.read("turns"))
        t.write("turns", t.read("turns") + t.read("swapped"))

    def row(t: Tape) -> None:
        for column, value in enumerate((t.read("n"), t.time, t.read("turns"), t.input("double"))):
            t.record(column, value)

    def end(t: Tape) -> None:
        t.output('it\'s */ "n"', t.read("n"))
        t.output("it_s_*/_'n'", t.read("left"))

    program = Program(
        30.0,
        (RunPhase(Phase("begin", begin)),),
        (
            Unless0((Every(3, (RunPhase(Phase("count", count)),)),)),
            WhileAny("left", 2, (RunPhase(Phase("turn */ \\", turn)),)),
            RecordPhase(Phase("row", row), 2),
        ),
        (RunPhase(Phase("end", end)),),
        ("x", "double"),
        4,
        ('it\'s */ "n"', "it_s_*/_'n'"),
    )
    for x in (0.0, 7.0, -1.0, math.nan):
        same(program, np.array([[x, 5.0]]), tmp_path, ("gcc", "-O1"), 20)


@pytest.mark.compiler
def test_the_text_is_the_same_each_time_and_asks_for_no_library(tmp_path: Path) -> None:
    need("gcc")
    assert driver(table(operations)) == driver(table(operations))
    source = (
        emit(record(table(operations))).text
        + "met_case now;\ndouble met_any(int64_t k);\ndouble met_any(int64_t k)\n{\n"
    )
    text = source + "    met_start(&now);\n    met_tick(&now, k);\n    met_end(&now);\n    return now.row[0];\n}\n"
    (tmp_path / "program.c").write_text(text, encoding="utf-8")
    for level in ("-O0", "-O3"):
        words = ["gcc", *STRICT, level, "-ffreestanding", "-c", "-o", tmp_path / "program.o", tmp_path / "program.c"]
        subprocess.run(words, check=True)
        done = subprocess.run(["nm", "--undefined-only", tmp_path / "program.o"], capture_output=True, text=True)
        assert done.stdout == ""


@pytest.mark.compiler
@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("gcc", "-ffast-math"), "build without -ffast-math, for a processor that computes doubles as doubles"),
        (("gcc", "-mfma", "-std=gnu11"), "build with -std=c11 and -ffp-contract=off"),
    ],
)
def test_a_build_that_would_change_bits_is_refused(tmp_path: Path, words: tuple[str, ...], message: str) -> None:
    need("gcc")
    (tmp_path / "program.c").write_text(emit(record(table(operations))).text, encoding="utf-8")
    done = subprocess.run([*words, "-fsyntax-only", tmp_path / "program.c"], capture_output=True, text=True)
    assert done.returncode == 1
    assert f'#error "{message}"' in done.stderr


@pytest.mark.compiler
def test_the_sanitizers_find_nothing(tmp_path: Path) -> None:
    words = ("gcc", "-O1", "-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    same(table(operations), three(300, 4), tmp_path, words)


@pytest.mark.parametrize(("value", "text"), [
    (0.0, "0.0"), (-0.0, "-0.0"), (7.0, "7.0"), (-0.5, "-0.5"), (0.1, "0x1.999999999999ap-4"), (2.0**-32, "0x1p-32"),
    (6755399441055744.0, "6755399441055744.0"), (1e22, "1e+22"), (1e23, "0x1.52d02c7e14af6p+76"),
    (5e-324, "0x0.0000000000001p-1022"),
])  # fmt: skip
def test_numbers_are_written_exactly(value: float, text: str) -> None:
    assert literal(value) == text
