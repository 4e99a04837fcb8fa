"""WebAssembly: an object made a module, a multiply-add that is rounded once, and the bits of whole runs under node."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from benchmarks.arms import SEVEN, Arm

from met import backends, models
from met.backends.llvm import machine
from met.backends.wasm import link, module
from met.trace import fma
from met.trace.primitives import fused
from met.trace.program import Phase, Program, Recording, RecordPhase, RunPhase, Tape
from met.trace.recorder import record
from tests.ic.small_decks import experiment
from tests.met.backends import whole_runs
from tests.met.backends.whole_runs import WholeRun, differing, whole_run
from tests.met.program.test_followers import GROUPS
from tests.met.program.test_loops import LINKED
from tests.met.small_models import EVERY, smallest

MACHINE = pytest.mark.parametrize("machine", [pytest.param(False, id="own fma"), pytest.param(None, id="found out")])


def one_row(body: str = "fma") -> Recording:
    """A program that records fma(a, b, c) at tick 0."""

    def row(tape: Tape) -> None:
        tape.record(0, fma(tape.input("a"), tape.input("b"), tape.input("c")))

    return record(Program(1.0, (), (RecordPhase(Phase(body, row), 1),), (), ("a", "b", "c"), 1))


def operands() -> np.ndarray:
    """[case, a b c]: usual ones, and those that round by a hair, cancel, vanish or overflow."""
    rng = np.random.default_rng(11)
    n = 40_000

    def some(low: int, high: int) -> np.ndarray:
        return np.ldexp(rng.choice([-1.0, 1.0], n) * rng.uniform(1, 2, n), rng.integers(low, high, n))

    short = rng.integers(-(1 << 30), 1 << 30, (n, 3)).astype(float)
    usual = np.stack([some(-30, 30), some(-30, 30), some(-60, 60)], 1)
    near = np.stack([some(-30, 30), some(-30, 30), np.zeros(n)], 1)
    near[:, 2] = -near[:, 0] * near[:, 1] * (1 + rng.integers(-2, 3, n) * 2.0**-52)
    halves = np.stack([1 + rng.integers(0, 8, n) * 2.0**-52, 1 + rng.integers(0, 8, n) * 2.0**-52, some(-110, 60)], 1)
    wide = np.stack([some(-1074, 1024), some(-1074, 1024), some(-1074, 1024)], 1)
    # products from 2^-1080 to 2^-1018, and sums there: results with few bits, or none
    low = rng.integers(-990, -40, n)
    tiny = np.stack([some(-1, 1), some(-1, 1), some(-1074, -1018)], 1)
    tiny[:, 0] = np.ldexp(tiny[:, 0], low)
    tiny[:, 1] = np.ldexp(tiny[:, 1], rng.integers(-1080, -1018, n) - low)
    # small whole numbers in units of 2^-1077: half way between two results, or a hair from it
    few = np.ldexp(rng.integers(-40, 41, (n, 3)).astype(float), [-500, -577, -1074])
    vast = np.stack([some(480, 540), some(480, 512), some(960, 1024)], 1)
    special = [0.0, -0.0, 1.0, -1.5, math.inf, -math.inf, math.nan, 5e-324, -5e-324, 2.0**-1022, 1.7976931348623157e308]
    special += [2.0**-537, -(2.0**-538), 2.0**512, 2.0**511, 1 + 2.0**-52, 2.0**480, 2.0**-480, 2.0**1000]
    crossed = np.array([(a, b, c) for a in special for b in special for c in special])
    with np.errstate(all="ignore"):
        return np.concatenate([short, usual, near, halves, wide, tiny, few, vast, crossed])


def same(found: np.ndarray, right: np.ndarray) -> np.ndarray:
    """True where bits are equal; what is not a number is equal to any other."""
    return (found.view(np.int64) == right.view(np.int64)) | (np.isnan(found) & np.isnan(right))


@pytest.mark.node
@MACHINE
def test_a_multiply_add_is_rounded_once_for_operands_of_any_size(machine: bool | None) -> None:
    given = operands()
    rows, _ = backends.load(one_row()).run(given, 0)
    assert rows is not None
    native = rows[:, 0, 0]
    exact = np.array([fused(*case) for case in given[::97].tolist()])
    assert same(native[::97], exact).all()
    found = module.ask(module.compiled(one_row()), given, 0, 0, machine=machine).rows[:, 0, 0]
    wrong = ~same(found, native)
    assert not wrong.any(), f"{wrong.sum()} of {len(given)}, first {given[wrong.argmax()]}: {found[wrong.argmax()]!r}"
    assert (np.abs(native) < 2.0**-1022).sum() > 30_000  # so many have few bits


def counted(run: WholeRun, machine: bool | None, *, quick: bool = False) -> tuple[int, int]:
    """Numbers of a run's rows and outputs that node and the native kernel computed, and how many differ."""
    found = module.ask(module.compiled(run.recording, quick=quick), run.inputs, 0, run.last, machine=machine)
    pairs = list(zip(run.native(), (found.rows, found.outputs), strict=True))
    return sum(a.size for a, _ in pairs), sum(differing(a, b) for a, b in pairs)


@pytest.mark.release
@pytest.mark.node
@MACHINE
@pytest.mark.parametrize(("kind", "name"), EVERY)
def test_every_model_has_the_native_bits(kind: models.Kind, name: str, machine: bool | None, tmp_path: Path) -> None:
    deck = experiment(tmp_path, smallest(kind, name).put(tmp_path).deck(), select=["cases"])
    assert counted(whole_run(name, deck, cases=7), machine)[1] == 0


@pytest.mark.release
@pytest.mark.node
@MACHINE
@pytest.mark.parametrize(
    ("deck", "run"),
    [pytest.param(*each, marks=[pytest.mark.slow] if each in whole_runs.LONG else []) for each in whole_runs.PUBLISHED],
)
def test_whole_runs_of_published_arms_have_the_native_bits(deck: str, run: str, machine: bool | None) -> None:
    count, wrong = counted(whole_runs.published(deck, run), machine)
    assert wrong == 0 and count > 4_000


@pytest.mark.release
@pytest.mark.node
@MACHINE
@pytest.mark.parametrize(("arm", "model"), whole_runs.REVERSING, ids=lambda of: of.name if isinstance(of, Arm) else of)
def test_arms_of_2_7_and_30_joints_that_reverse_have_the_native_bits(
    arm: Arm, model: str, machine: bool | None
) -> None:
    count, wrong = counted(whole_runs.reversing(arm, model), machine)
    assert wrong == 0 and count > 1_000


@pytest.mark.node
@MACHINE
@pytest.mark.parametrize(("text", "sweep"), [(GROUPS, "ratios"), (LINKED, "places")], ids=["ratios", "loops"])
def test_joints_that_follow_others_have_the_native_bits(
    text: str, sweep: str, machine: bool | None, tmp_path: Path
) -> None:
    count, wrong = counted(whole_run(sweep, experiment(tmp_path, text, select=[sweep]), cases=3), machine)
    assert wrong == 0 and count > 1_000


@pytest.mark.release
@pytest.mark.node
@MACHINE
def test_a_module_that_is_sooner_made_has_the_same_bits(machine: bool | None) -> None:
    given = operands()[::31]
    usual, quick = (
        module.ask(module.compiled(one_row(), quick=each), given, 0, 0, machine=machine) for each in (False, True)
    )
    assert same(usual.rows, quick.rows).all()
    for deck, run in (("two_link", "hybrid"), ("panda", "swing"), ("free_flyer", "flyer_felt")):
        count, wrong = counted(whole_runs.published(deck, run), machine, quick=True)
        assert wrong == 0 and count > 2_000
    for model in ("lugre", "plume, 36 cells", "tachometer with noise"):
        count, wrong = counted(whole_runs.reversing(SEVEN, model), machine, quick=True)
        assert wrong == 0 and count > 500
    assert module.compiled(one_row(), quick=True).code != module.compiled(one_row()).code


def wide(columns: int) -> Recording:
    """A program whose rows do not fit on the stack."""

    def row(tape: Tape) -> None:
        x = tape.input("x")
        for column in range(columns):
            tape.record(column, x * (column + 0.1))

    end = RunPhase(Phase("end", lambda tape: tape.output("y", tape.input("x"))))
    return record(Program(1.0, (), (RecordPhase(Phase("row", row), 1),), (end,), ("x",), columns, ("y",)))


@pytest.mark.release
@pytest.mark.node
def test_rows_that_do_not_fit_on_the_stack_get_memory_once() -> None:
    recording = wide(20_000)
    made = module.compiled(recording)
    assert "call ptr @malloc" in module.text(recording)
    given = np.linspace(-1.0, 1.0, 7)[:, None]
    rows, outputs = backends.load(recording).run(given, 3)
    found = module.ask(made, given, 0, 3, times=3)
    assert rows is not None and rows.tobytes() == found.rows.tobytes()
    assert outputs.tobytes() == found.outputs.tobytes()


def test_a_module_that_is_made_meanwhile_is_the_same_and_fails_where_it_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recording = wide(30)
    for quick in (False, True):
        assert module.begun(recording, quick=quick)().code == module.compiled(recording, quick=quick).code

    def failing(*_: object, **__: object) -> bytes:
        raise RuntimeError("no room")

    monkeypatch.setattr(machine, "assemble", failing)
    monkeypatch.setenv("MET_CACHE_DIR", "")
    asked = module.begun(wide(31))
    with pytest.raises(RuntimeError, match="no room"):
        asked()


def test_a_module_lists_where_it_multiplies_and_adds() -> None:
    recording = one_row()
    made = module.compiled(recording)
    assert module.compiled(recording).code == made.code
    name = link.SITES.encode()
    assert made.fma_calls == module.text(recording).count("call <2 x double> @met_fma(") == 1
    listed = made.code[made.code.index(name) + len(name) :]
    at = sum((byte & 0x7F) << (7 * n) for n, byte in enumerate(listed))
    assert made.code[at] == 0x10 and made.code[at + 1] >= 0x80  # a call, and a number of two bytes


def test_what_a_program_says_of_its_memory() -> None:
    made = module.compiled(one_row()).description
    assert made["inputs"] == ["a", "b", "c"] and made["outputs"] == [] and made["columns"] == 1
    assert made["heap"] % 64 == 0 and made["heap"] >= link.STACK and made["lanes"] == 2


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("declare void @gone()\ndefine void @f() { call void @gone()\n ret void }", "asks for gone, which is nowhere"),
        ("define void @g() { ret void }", "lacks the function f"),
        ("@x = external global i8\ndefine ptr @f() { ret ptr @x }", "lacks the data x"),
    ],
)
def test_an_object_that_is_not_whole_is_refused(text: str, words: str) -> None:
    obj = machine.assemble(text, machine.wasm32())
    with pytest.raises(ValueError, match=words):
        link.link(obj, "f", "f")


def test_without_node_there_is_a_module_and_no_run(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    kernel = backends.load(one_row(), name="wasm")
    assert kernel.code_bytes > 1_000
    with pytest.raises(RuntimeError, match="there is no `node` here"):
        kernel.run(np.ones((1, 3)), 0)
