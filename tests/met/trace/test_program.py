"""Programs: memory, control, what recording keeps and drops, what it refuses; the pass that fuses; the cutting."""

from __future__ import annotations

import numpy as np
import pytest

from met.backends.llvm.kernel import from_recording
from met.backends.llvm.pieces import cut, operations
from met.backends.reference.plain import execute
from met.trace import sin, where
from met.trace.nodes import OPERANDS
from met.trace.program import CallPhase, Every, Phase, Program, RecordPhase, RunPhase, Unless0, WhileAny
from met.trace.recorder import record


def run(*bodies):
    return tuple(RunPhase(Phase(f"p{i}", body)) for i, body in enumerate(bodies))


def program(tick, *, start=(), end=(), inputs=("a", "b", "c"), columns=0, outputs=()):
    return Program(10.0, start, tick, end, inputs, columns, outputs)


def ops(section):
    return [section.nodes[i][0] for i in operations(section)]


COUNT = Phase("count", lambda t: t.write("n", t.read("n") + 1.0))
SHOW = Phase("show", lambda t: t.output("n", t.read("n")))
ROW = Phase("row", lambda t: t.record(0, t.read("n")))


# The plain run


def test_ticks_are_run_at_both_ends_and_the_start_once():
    begin = Phase("begin", lambda t: t.write("n", 100.0))
    one = program((RunPhase(COUNT),), start=(RunPhase(begin),), end=(RunPhase(SHOW),), inputs=(), outputs=("n",))
    assert execute(one, {}, 0)[1] == {"n": 101.0}
    assert execute(one, {}, 5)[1] == {"n": 106.0}


def test_every_divides_the_tick_and_unless0_leaves_out_the_first():
    every = program((Every(3, (RunPhase(COUNT),)),), end=(RunPhase(SHOW),), inputs=(), outputs=("n",))
    assert [execute(every, {}, k)[1]["n"] for k in range(7)] == [1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 3.0]
    later = program((Unless0((RunPhase(COUNT),)),), end=(RunPhase(SHOW),), inputs=(), outputs=("n",))
    assert [execute(later, {}, k)[1]["n"] for k in range(3)] == [0.0, 1.0, 2.0]


def test_rows_are_recorded_in_their_place_among_the_phases():
    before = program((RecordPhase(ROW, 2), RunPhase(COUNT)), inputs=(), columns=1)
    after = program((RunPhase(COUNT), RecordPhase(ROW, 2)), inputs=(), columns=1)
    assert execute(before, {}, 5)[0].tolist() == [[0.0], [2.0], [4.0]]
    assert execute(after, {}, 5)[0].tolist() == [[1.0], [3.0], [5.0]]


def test_while_any_ends_with_its_cell_or_with_its_limit():
    ask = Phase("ask", lambda t: t.write("left", t.input("a")))
    less = Phase("less", lambda t: (t.write("left", t.read("left") - 1.0), t.write("n", t.read("n") + 1.0)))
    one = program(
        (RunPhase(ask), WhileAny("left", 4, (RunPhase(less),))), end=(RunPhase(SHOW),), inputs=("a",), outputs=("n",)
    )
    assert [execute(one, [float(a)], 0)[1]["n"] for a in range(7)] == [0.0, 1.0, 2.0, 3.0, 4.0, 4.0, 4.0]


def test_the_plain_run_divides_by_zero_as_ieee_does():
    end = run(lambda t: t.output("x", 1.0 / t.input("a")))
    assert execute(program((), end=end, outputs=("x",)), {"a": 0.0, "b": 0.0, "c": 0.0}, 0)[1]["x"] == float("inf")


# Recording


def test_neighbouring_runs_are_one_section_and_pass_values_without_memory():
    recording = record(
        program(
            run(
                lambda t: t.write("x", t.input("a") + 1.0),
                lambda t: t.write("y", t.read("x") * t.read("y") + t.read("x")),
            ),
            end=run(lambda t: t.output("y", t.read("y"))),
            outputs=("y",),
        )
    )
    assert len(recording.tick) == 1
    assert recording.cells == ("y",)
    assert ops(recording.sections[0]) == ["add", "fma"]


def test_a_called_phase_is_there_once_and_passes_values_through_memory():
    twice = Phase("twice", lambda t: t.write("n", t.read("n") + t.read("n")))
    one = program(
        (
            RunPhase(COUNT),
            CallPhase(twice),
            RunPhase(COUNT),
            Every(2, (CallPhase(twice), RunPhase(COUNT))),
            CallPhase(twice),
        ),
        end=(RunPhase(SHOW),),
        inputs=(),
        outputs=("n",),
    )
    recording = record(one)
    assert [section.name for section in recording.sections].count("twice") == 1
    assert [execute(one, {}, k)[1]["n"] for k in range(2)] == [14.0, 62.0]
    kernel = from_recording(recording, lanes=2)
    assert [kernel.run(np.zeros((1, 0)), k)[1][0, 0] for k in range(2)] == [14.0, 62.0]


def test_every_tick_is_no_condition():
    recording = record(
        program((RunPhase(COUNT), Every(1, (RunPhase(COUNT),)), RunPhase(COUNT)), end=(RunPhase(SHOW),), outputs=("n",))
    )
    assert len(recording.tick) == 1


def test_what_nothing_reads_is_dropped_with_all_that_only_it_needs():
    def body(t):
        t.write("seen", t.read("seen") + t.input("a"))
        t.write("unseen", sin(t.read("seen")))
        t.write("only unseen", t.read("unseen") + t.read("only unseen 2"))
        t.write("only unseen 2", t.read("only unseen 3"))

    recording = record(program(run(body), end=run(lambda t: t.output("x", t.read("seen"))), outputs=("x",)))
    assert recording.cells == ("seen",)
    assert ops(recording.sections[0]) == ["add"]


def test_a_cell_that_only_a_condition_reads_is_kept():
    ask = Phase("ask", lambda t: t.write("left", t.input("a")))
    recording = record(
        program((RunPhase(ask), WhileAny("left", 1, (RunPhase(COUNT),))), end=(RunPhase(SHOW),), outputs=("n",))
    )
    assert set(recording.cells) == {"left", "n"}


def test_masks_pass_through_memory():
    def first(t):
        t.write_mask("m", t.input("a") > 0.0)

    def second(t):
        t.write("x", where(t.read_mask("m"), 1.0, 2.0))

    end = run(lambda t: t.output("x", t.read("x")))
    one = program((*run(first), Every(2, run(second))), end=end, outputs=("x",))
    assert [execute(one, [a, 0.0, 0.0], 0)[1]["x"] for a in (1.0, -1.0)] == [1.0, 2.0]
    assert record(one).cells == ("m", "x")


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (lambda: program((Every(2, (RecordPhase(ROW, 4),)),), columns=1), "within another condition"),
        (lambda: program((RecordPhase(ROW, 2), RecordPhase(ROW, 3)), columns=1), "one rate"),
        (lambda: program((RecordPhase(ROW, 1),), columns=2), r"no phase records columns \[1\]"),
        (lambda: program((), outputs=("x",)), r"no phase writes the outputs \['x'\]"),
        (lambda: program((RecordPhase(ROW, 1),), start=(RecordPhase(ROW, 1),), columns=1), "rows belong to ticks"),
        (lambda: program(run(lambda t: t.record(0, 1.0)), columns=1), "recorded in a tick phase"),
        (lambda: program(run(lambda t: t.output("x", 1.0)), outputs=("x",)), "before the end"),
        (lambda: program(run(lambda t: t.input("nothing"))), "no input 'nothing'"),
    ],
)
def test_a_program_that_cannot_be_is_refused(wrong, message):
    with pytest.raises(ValueError, match=message):
        record(wrong())


def test_a_value_does_not_leave_its_phase_but_through_a_cell():
    held = []
    bodies = (*run(lambda t: held.append(t.input("a") + 1.0)), Every(2, run(lambda t: t.write("x", held[0]))))
    with pytest.raises(ValueError, match="through a cell"):
        record(program(bodies))


# Fusing


def fused(body, count=1):
    end = run(lambda t: [t.output(f"x{i}", value) for i, value in enumerate(body(*(t.input(n) for n in "abc")))])
    return ops(record(program((), end=end, outputs=tuple(f"x{i}" for i in range(count)))).sections[0])


def test_a_product_that_one_sum_takes_is_fused():
    assert fused(lambda a, b, c: [a * b + c]) == ["fma"]
    assert fused(lambda a, b, c: [c - a * b]) == ["fma"]
    assert fused(lambda a, b, c: [a * b - c]) == ["fma"]
    assert fused(lambda a, b, c: [a * b + b * c]) == ["mul", "fma"]


def test_a_product_that_is_also_used_otherwise_is_not():
    assert fused(lambda a, b, c: [a * b + c, a * b], 2) == ["mul", "add"]
    assert fused(lambda a, b, c: [a * b + c, (a * b) * c], 2) == ["mul", "add", "mul"]


def test_fused_signs_are_right():
    for body, expected in (
        (lambda a, b, c: a * b - c, 2.0),
        (lambda a, b, c: c - a * b, -2.0),
        (lambda a, b, c: -(a * b) - c, -10.0),
        (lambda a, b, c: c + a * -b, -2.0),
    ):

        def make(t, body=body):
            t.output("x", body(t.input("a"), t.input("b"), t.input("c")))

        one = program((), end=run(make), outputs=("x",))
        (section,) = record(one).sections
        assert ops(section) == ["fma"]
        from met.trace.nodes import evaluate

        values = evaluate(section.nodes, section.order, lambda n: {"a": 2.0, "b": 3.0, "c": 4.0}[n[1]], arrays=False)
        ((_, ref),) = section.outputs
        assert (-values[ref >> 1] if ref & 1 else values[ref >> 1]) == expected


# Cutting


def test_pieces_hold_every_operation_once_and_pass_what_crosses():
    def body(t):
        x = [t.read(f"x{i}") for i in range(6)]
        for n in range(300):
            x[n % 6] = x[n % 6] * x[(n + 1) % 6] + 0.5 * x[(n + 2) % 6]
        for i in range(6):
            t.write(f"x{i}", x[i])

    (section, _) = record(program(run(body), end=run(lambda t: t.output("x", t.read("x0"))), outputs=("x",))).sections
    pieces = cut(section, above=100, shortest=30, longest=60)
    body_of = [i for piece in pieces for _, i in piece.body]
    assert body_of == operations(section)
    assert all(30 <= len(piece.body) <= 60 for piece in pieces[:-1])
    held: dict[int, int] = {}  # slot -> the value in it
    for piece in pieces:
        here = {i for _, i in piece.body}
        for _, i in piece.body:
            node = section.nodes[i]
            for ref in node[1 : 1 + OPERANDS[node[0]]]:
                if ref >> 1 in body_of and ref >> 1 not in here:
                    assert held[piece.saved[ref >> 1]] == ref >> 1
        held.update({slot: i for i, slot in piece.keep.items()})
    assert len(set(held)) <= 12  # slots are used again: six values cross, and few more
