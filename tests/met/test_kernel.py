"""Machine code against the plain run; the same bits whatever it is made for; a block kept between calls."""

from __future__ import annotations

import math
import os
import re
import subprocess
import sys
import threading

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from met.backends.llvm import kernel
from met.backends.reference.plain import execute
from met.diagnostic import Problem
from met.trace import (
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
    sign,
    sin,
    sqrt,
    tan,
    tanh,
    where,
)
from met.trace.nodes import evaluate, live
from met.trace.program import Every, Phase, Program, RecordPhase, RunPhase, Unless0, WhileAny
from met.trace.recorder import record
from tests.instruction_sets import RUNNABLE


@pytest.fixture(autouse=True, scope="module")
def own_cache(tmp_path_factory):
    old = os.environ.get("MET_CACHE_DIR")
    os.environ["MET_CACHE_DIR"] = str(tmp_path_factory.mktemp("cache"))
    yield
    if old is None:
        del os.environ["MET_CACHE_DIR"]
    else:
        os.environ["MET_CACHE_DIR"] = old


def phase(name):
    return lambda body: Phase(name, body)


def machine_like_program():
    """A small program with everything in it: rates, a loop that only some cases need, rows, masks, tables."""

    @phase("begin")
    def begin(t):
        t.write("q", t.input("q"))
        t.write("v", 0.0)
        t.write("unread", t.input("q") * 2.0)

    @phase("servo")
    def servo(t):
        t.write("u", clip(t.input("gain") * (1.0 - t.read("v")), -2.0, 2.0))
        t.write("count", t.read("count") + 1.0)
        t.write_mask("fast", t.read("v") > 0.5)

    @phase("step")
    def step(t):
        q, v = t.read("q"), t.read("v")
        a = t.read("u") - sin(q) * cos(q) + gather((0.0, 0.1, 0.2), floor(abs(q)))
        a = where(t.read_mask("fast"), a - 0.1 * v, a)
        t.write("v", v + 0.01 * a)
        t.write("q", q + 0.01 * v)

    @phase("ask")
    def ask(t):
        t.write("left", where(t.read("q") > 0.2, 3.0 + floor(t.read("q") * 10.0), 0.0))

    @phase("halve")
    def halve(t):
        left = t.read("left")
        t.write("q", where(left > 0.0, t.read("q") * 0.999, t.read("q")))
        t.write("left", maximum(left - 1.0, 0.0))

    @phase("row")
    def row(t):
        for column, value in enumerate((t.time, t.tick, t.read("q"), t.read("v"), t.read("count"))):
            t.record(column, value)

    @phase("finish")
    def finish(t):
        t.output("q", t.read("q"))
        t.output("time", t.time)

    return Program(
        300.0,
        (RunPhase(begin),),
        (
            Every(3, (RunPhase(servo),)),
            Unless0((RunPhase(step), RunPhase(ask), WhileAny("left", 4, (RunPhase(halve),)))),
            RecordPhase(row, 2),
        ),
        (RunPhase(finish),),
        ("q", "gain"),
        5,
        ("q", "time"),
    )


def some_cases(count, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 2))


def test_machine_code_and_the_plain_run_agree_on_all_control():
    program, inputs = machine_like_program(), some_cases(21)
    rows, outputs = kernel.compile(program).run(inputs, 41)
    for case in range(21):
        plain_rows, plain_outputs = execute(program, inputs[case], 41)
        # a fused multiply-add rounds once where the plain run rounds twice: some 40 steps of 1e-16
        np.testing.assert_allclose(rows[case], plain_rows, rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(outputs[case], list(plain_outputs.values()), rtol=1e-13)


@pytest.mark.parametrize("ticks", [0, 1, 2, 3, 7])
def test_rows_are_those_of_both_ends(ticks):
    rows, outputs = kernel.compile(machine_like_program()).run(some_cases(3), ticks)
    assert rows.shape == (3, ticks // 2 + 1, 5)
    assert rows[0, :, 1].tolist() == [2.0 * i for i in range(ticks // 2 + 1)]
    assert outputs[0, 1] == ticks / 300.0


def test_time_is_the_tick_over_the_base_rate_by_one_division():
    rows, _ = kernel.compile(machine_like_program()).run(some_cases(1), 1000)
    assert rows[0, :, 0].tolist() == [k / 300.0 for k in range(0, 1001, 2)]


# Bits


def bits(k, inputs, ticks=60, **options):
    rows, outputs = k.run(inputs, ticks, **options)
    return rows.tobytes() + outputs.tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("lanes", [2, 4, 8, 16, 32])
def test_bits_do_not_depend_on_lanes(lanes):
    program, inputs = machine_like_program(), some_cases(45)
    assert bits(kernel.compile(program, lanes), inputs) == bits(kernel.compile(program, 8), inputs)


@pytest.mark.slow
@pytest.mark.parametrize("level", [0, 1, 3])
@pytest.mark.parametrize("lanes", [4, 8])
def test_bits_do_not_depend_on_optimisation(level, lanes):
    program, inputs = machine_like_program(), some_cases(45)
    assert bits(kernel.compile(program, lanes, level=level), inputs) == bits(kernel.compile(program), inputs)


@pytest.mark.parametrize("cpu", RUNNABLE)
def test_bits_do_not_depend_on_the_instruction_set(cpu):
    program, inputs = machine_like_program(), some_cases(45)
    assert bits(kernel.compile(program, cpu=cpu), inputs) == bits(kernel.compile(program), inputs)


def test_bits_do_not_depend_on_threads_order_or_company():
    k, inputs = kernel.compile(machine_like_program()), some_cases(300)
    rows, outputs = k.run(inputs, 60, threads=1)
    assert bits(k, inputs, threads=3) == rows.tobytes() + outputs.tobytes()
    order = np.random.default_rng(1).permutation(300)
    assert k.run(inputs[order], 60)[0].tobytes() == rows[order].tobytes()
    for case in (0, 17, 299):
        assert k.run(inputs[case : case + 1], 60)[0].tobytes() == rows[case : case + 1].tobytes()


def test_bits_do_not_depend_on_recording():
    k, inputs = kernel.compile(machine_like_program()), some_cases(50)
    rows, outputs = k.run(inputs, 60, record=False)
    assert rows is None
    assert outputs.tobytes() == k.run(inputs, 60)[1].tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("columns", [1, 3, 8, 9, 64, 100])
def test_rows_of_any_width_reach_their_case(columns):
    row = Phase("row", lambda t: [t.record(i, t.input("x") * 1000.0 + t.tick + i / 128.0) for i in range(columns)])
    program = Program(1.0, (), (RecordPhase(row, 1),), (), ("x",), columns, ())
    for lanes, cpu in ((4, "haswell"), (16, None), (2, None)):
        for cases in (1, 5, 33):
            x = np.arange(1.0, cases + 1.0)[:, None]
            rows, _ = kernel.compile(program, lanes, cpu).run(x, 10)
            expected = x[:, :, None] * 1000.0 + np.arange(11.0)[None, :, None] + np.arange(columns) / 128.0
            assert np.array_equal(rows, expected)


# Random expressions


UNARY = [
    lambda x: -x,
    abs,
    sqrt,
    sin,
    cos,
    tan,
    exp,
    log,
    tanh,
    floor,
    rint,
    sign,
    lambda x: x * x,
    lambda x: x**3,
    lambda x: clip(x, -1.0, 2.0),
    lambda x: gather((0.5, -1.0, 3.0), x),
    lambda x: 1.0 / x,
]
BINARY = [
    lambda a, b: a + b,
    lambda a, b: a - b,
    lambda a, b: a * b,
    lambda a, b: a / b,
    minimum,
    maximum,
    atan2,
    lambda a, b: where(a < b, a, -b),
    lambda a, b: where(either(a == b, not_(a <= 1.0)), b, a * 0.5),
    lambda a, b: where(both(a > 0.0, is_nan(b)), 7.0, a),
    lambda a, b: a * 3.0 + b,
]


@pytest.mark.slow
def test_a_row_may_be_longer_than_a_threads_stack():
    """Threads have 512 KiB on some systems; of 32 lanes, 3,000 columns take 750 KiB."""
    columns = 3000

    def rows(t):
        for column in range(columns):
            t.record(column, t.input("a") * t.tick + float(column))

    program = Program(10.0, (), (RecordPhase(Phase("rows", rows), 1),), (), ("a",), columns)
    made = kernel.compile(program, 32)
    cases = np.arange(40.0)
    found = []
    before = threading.stack_size(1 << 19)
    try:
        thread = threading.Thread(target=lambda: found.append(made.run(cases[:, None], 2, threads=1)[0]))
        thread.start()
        thread.join()
    finally:
        threading.stack_size(before)
    expected = cases[:, None, None] * np.arange(3.0)[:, None] + np.arange(float(columns))
    assert np.array_equal(found[0], expected)


@st.composite
def expressions(draw):
    """Functions of three numbers, as lists of steps over what is there already."""
    return draw(
        st.lists(
            st.one_of(
                st.tuples(st.sampled_from(UNARY), st.integers(0, 40)),
                st.tuples(st.sampled_from(BINARY), st.integers(0, 40), st.integers(0, 40)),
                st.tuples(st.just(fma), st.integers(0, 40), st.integers(0, 40), st.integers(0, 40)),
            ),
            min_size=3,
            max_size=40,
        )
    )


def build(steps, x, y, z):
    values = [x, y, z, np.float64(0.5)]
    for function, *operands in steps:
        values.append(function(*(values[i % len(values)] for i in operands)))
    return values[4:]


NUMBERS = np.array(
    [
        [0.3, -1.7, 2.5],
        [1e-3, 40.0, -7.0],
        [0.0, 1.0, -1.0],
        [math.nan, 1.0, 2.0],
        [1.0, math.nan, 0.1],
        [math.inf, 1.0, -2.0],
        [-3.0, 1e10, 1e-10],
    ]
)


def as_program(steps):
    def body(t):
        for i, value in enumerate(build(steps, t.input("x"), t.input("y"), t.input("z"))):
            t.output(f"o{i}", value)

    outputs = tuple(f"o{i}" for i in range(len(steps)))
    return Program(1.0, (), (), (RunPhase(Phase("all", body)),), ("x", "y", "z"), 0, outputs)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(expressions())
def test_machine_code_has_the_bits_of_a_numpy_replay_of_its_graph(steps):
    with np.errstate(all="ignore"):
        recording = record(as_program(steps))
    (section,) = recording.sections
    columns = {name: NUMBERS[:, i] for i, name in enumerate(("x", "y", "z"))}
    with np.errstate(all="ignore"):
        values = evaluate(section.nodes, live(section.nodes, section.roots), lambda node: columns[node[1]], arrays=True)
    for lanes, level in ((8, 2), (4, 0)):
        _, outputs = kernel.from_recording(recording, lanes, level=level).run(NUMBERS, 0)
        for number, ref in section.outputs:
            value = np.broadcast_to(values[ref >> 1], len(NUMBERS))
            assert np.array_equal(outputs[:, number], -value if ref & 1 else value, equal_nan=True)


STEADY = [*BINARY[:3], lambda a, b: where(a < b, a, b), lambda a, b: a * 0.5 + b]


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from(STEADY), st.integers(0, 40), st.integers(0, 40)), min_size=3, max_size=25),
    st.integers(0, 2**32 - 1),
)
def test_machine_code_agrees_with_plain_floats_to_rounding(steps, seed):
    # the same steps over sizes bound what rounding can do: each step may lose one part in 2^52 of what went in. A
    # choice by comparison may fall either way within that, and then both values are within it
    inputs = np.random.default_rng(seed).uniform(-1.0, 1.0, (5, 3))
    _, outputs = kernel.from_recording(record(as_program(steps)), 8).run(inputs, 0)
    for case in range(5):
        plain = build(steps, *inputs[case].tolist())
        sizes = [1.0, 1.0, 1.0, 0.5]
        for function, *operands in steps:
            a, b = (sizes[i % len(sizes)] for i in operands)
            sizes.append(max(1.0, a * b if function is STEADY[2] else a + b))
        for value, expected, size in zip(outputs[case], plain, sizes[4:], strict=True):
            assert abs(value - expected) <= 4.0 * len(steps) ** 2 * 2.0**-52 * size


def test_not_a_number_reaches_the_end_through_limits():
    def body(t):
        x = t.input("x")
        t.output("clip", clip(x, -1.0, 1.0))
        t.output("min", minimum(x, t.input("y")))
        t.output("max", maximum(t.input("y"), x))
        t.output("constant", minimum(x, 1.0))

    program = Program(1.0, (), (), (RunPhase(Phase("p", body)),), ("x", "y"), 0, ("clip", "min", "max", "constant"))
    for lanes, cpu, level in ((4, "haswell", 2), (8, None, 3), (8, None, 0)):
        _, outputs = kernel.compile(program, lanes, cpu, level=level).run(np.array([[math.nan, 0.0]]), 0)
        assert np.isnan(outputs).all()


def test_the_compiler_fuses_nothing_by_itself():
    # x*y - z of numbers whose product is not exact: fused, the difference is the product's rounding error, not zero
    def body(t):
        product = t.input("x") * t.input("y")
        t.output("product", product)  # a product that is asked for stays one
        t.output("difference", product - t.input("z"))

    program = Program(1.0, (), (), (RunPhase(Phase("p", body)),), ("x", "y", "z"), 0, ("product", "difference"))
    x = np.array([[0.1, 0.1, 0.1 * 0.1]])
    for level in (0, 2, 3):
        assert kernel.compile(program, level=level).run(x, 0)[1].tolist() == [[0.1 * 0.1, 0.0]]


@pytest.mark.release
def test_a_long_section_cut_into_pieces_has_the_same_bits():
    from met.backends.llvm import machine as llvm
    from met.backends.llvm.emit import emit

    def body(t):
        x = [t.read(f"x{i}") for i in range(12)]
        for n in range(900):
            i, j = n % 12, (n * 7 + 3) % 12
            x[i] = where(x[i] > x[j], 0.25 * (x[j] * x[(n + 5) % 12] - x[i]), x[i] + 0.5 * x[j] * x[j]) * 0.9
        for i in range(12):
            t.write(f"x{(i + 1) % 12}", x[i])
        a, b = t.read("swap a"), t.read("swap b")
        t.write("swap a", b)
        t.write("swap b", a + 1.0)

    start = Phase("start", lambda t: [t.write(f"x{i}", t.input("x") * (i + 1)) for i in range(12)])
    end = Phase(
        "end",
        lambda t: (
            [t.output(f"o{i}", t.read(f"x{i}")) for i in range(12)]
            + [t.output("a", t.read("swap a")), t.output("b", t.read("swap b"))]
        ),
    )
    program = Program(
        1.0,
        (RunPhase(start),),
        (RunPhase(Phase("long", body)),),
        (RunPhase(end),),
        ("x",),
        0,
        (*(f"o{i}" for i in range(12)), "a", "b"),
    )
    recording, machine = record(program), llvm.machine()
    inputs = np.linspace(-0.1, 0.1, 11)[:, None]
    results = []
    for above, shortest, longest in ((10**9, 1, 1), (100, 20, 60), (100, 200, 700)):
        text = emit(recording, 8, above=above, shortest=shortest, longest=longest)
        loaded = llvm.Loaded(llvm.assemble(text, machine), machine)
        results.append(kernel.LlvmKernel(recording, 8, machine, loaded, False).run(inputs, 4)[1])
        assert (len(set(re.findall(r"@section\.\d+\.\d+", text))) > 20) == (longest == 60)
    assert results[0].tobytes() == results[1].tobytes() == results[2].tobytes()
    plain = [list(execute(program, case, 4)[1].values()) for case in inputs]
    # five ticks of 900 contracting steps, fused or not
    np.testing.assert_allclose(results[0], plain, rtol=1e-9, atol=1e-12)


# A block kept between calls


def test_a_block_stepped_by_hand_is_the_run():
    program, inputs = machine_like_program(), some_cases(3)
    k = kernel.compile(program)
    rows, outputs = k.run(inputs, 40)
    block = k.block(inputs)
    pieces = [block.recorded(0, 6), block.recorded(7, 7), block.recorded(8, 9)]
    for tick in range(10, 40):
        block.step(tick, tick)
    pieces.append(block.recorded(40, 40))
    assert [piece.shape[1] for piece in pieces] == [4, 0, 1, 1]
    assert np.array_equal(np.concatenate(pieces, axis=1), rows[:, [0, 1, 2, 3, 4, 20]])
    assert np.array_equal(block.outputs[:, :3].T, outputs)


def test_tick_0_starts_a_block_afresh():
    block = kernel.compile(machine_like_program()).block(some_cases(2))
    first = block.recorded(0, 20)
    assert np.array_equal(block.recorded(0, 20), first)


def test_a_blocks_inputs_and_cells_may_be_changed_between_steps():
    add = Phase("add", lambda t: t.write("x", t.read("x") + t.input("u")))
    end = Phase("end", lambda t: t.output("x", t.read("x")))
    block = kernel.compile(Program(1.0, (), (RunPhase(add),), (RunPhase(end),), ("u",), 0, ("x",))).block([[1.0]])
    block.step(0, 2)
    block.inputs[0, 0] = 10.0
    block.cells()["x"][0] += 0.5
    block.step(3, 3)
    assert block.outputs[0, 0] == 13.5


# Running


@pytest.mark.parametrize("count", [1, 2])
def test_progress_is_told_from_the_callers_thread_up_to_all_cases(count):
    seen = []
    k = kernel.compile(machine_like_program())
    k.run(some_cases(1000), 5, threads=count, progress=lambda n: seen.append((n, threading.get_ident())))
    assert [n for n, _ in seen] == sorted(n for n, _ in seen) and seen[-1][0] == 1000
    assert len(seen) > 1 or count == 2  # two may have ended before they are looked at
    assert {thread for _, thread in seen} == {threading.get_ident()}


def test_an_interrupted_run_stops():
    def stop(_):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kernel.compile(machine_like_program()).run(some_cases(1000), 5, threads=2, progress=stop)


def test_no_cases_is_no_error():
    rows, outputs = kernel.compile(machine_like_program()).run(np.zeros((0, 2)), 10)
    assert rows.shape == (0, 6, 5) and outputs.shape == (0, 2)


def test_wrong_inputs_are_named():
    with pytest.raises(ValueError, match=r"\(3, 1\) for a program with 2 inputs"):
        kernel.compile(machine_like_program()).run(np.zeros((3, 1)), 10)


def test_a_processor_without_fma_is_refused_and_on_request_has_the_same_bits(monkeypatch):
    program, inputs = machine_like_program(), some_cases(9)
    with pytest.raises(Problem) as caught:
        kernel.compile(program, cpu="x86-64")
    assert caught.value.diagnostics[0].code == "E210"
    monkeypatch.setenv("MET_ALLOW_NO_FMA", "1")
    with pytest.warns(UserWarning, match="no fused multiply-add"):
        slow = kernel.compile(program, cpu="x86-64")
    assert bits(slow, inputs) == bits(kernel.compile(program), inputs)


# Importing


@pytest.mark.slow
def test_importing_the_kernel_does_not_import_llvm():
    code = "import sys, met.backends.llvm.kernel; sys.exit('llvmlite' in sys.modules)"
    assert (
        subprocess.run(
            [sys.executable, "-c", code], check=False, env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
        ).returncode
        == 0
    )
