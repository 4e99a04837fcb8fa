"""The generator: published answers, a generator of the same family in numpy, and one set of bits whatever runs it."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from met.backends.llvm import kernel
from met.backends.llvm import machine as llvm
from met.backends.llvm.emit import emit
from met.trace import Formulas, Graph
from met.trace.functions import philox
from met.trace.primitives import ARRAYS, PLAIN
from met.trace.program import Phase, Program, RunPhase
from met.trace.recorder import record
from tests.instruction_sets import RUNNABLE

# philox4x32-10 in the known-answer file of the authors' library, Random123: counter, key, result
ANSWERS = [
    ("00000000 00000000 00000000 00000000", "00000000 00000000", "6627e8d5 e169c58d bc57ac4c 9b00dbd8"),
    ("ffffffff ffffffff ffffffff ffffffff", "ffffffff ffffffff", "408f276d 41c83b0e a20bc7c6 6d5451fd"),
    ("243f6a88 85a308d3 13198a2e 03707344", "a4093822 299f31d0", "d16cfe09 94fdcceb 5001e420 24126ea1"),
]


def hexadecimal(text):
    return [int(word, 16) for word in text.split()]


def philox_of(bits, counter, key):
    """Philox4xW-10 for words of W bits, from the paper's description: multipliers and growth by word size."""
    low = (1 << bits) - 1
    multipliers, growth = {
        32: ((0xD2511F53, 0xCD9E8D57), (0x9E3779B9, 0xBB67AE85)),
        64: ((0xD2E7470EE14C6C93, 0xCA5A826395121157), (0x9E3779B97F4A7C15, 0xBB67AE8584CAA73B)),
    }[bits]
    (a, b, c, d), (k, m) = counter, key
    for n in range(10):
        left, right = divmod(a * multipliers[0], 1 << bits), divmod(c * multipliers[1], 1 << bits)
        a, b = right[0] ^ b ^ (k + n * growth[0] & low), right[1]
        c, d = left[0] ^ d ^ (m + n * growth[1] & low), left[1]
    return [a, b, c, d]


@pytest.mark.parametrize(("counter", "key", "result"), ANSWERS)
def test_the_published_answers_are_given(counter, key, result):
    operands = [float(x) for x in hexadecimal(counter) + hexadecimal(key)]
    assert [int(PLAIN["philox"](*operands, n)) for n in range(4)] == hexadecimal(result)
    assert [int(ARRAYS["philox"](*map(np.array, operands), n)) for n in range(4)] == hexadecimal(result)


def test_it_agrees_with_a_philox_that_agrees_with_numpys_at_64_bits():
    rng = np.random.default_rng(1)
    for _ in range(50):
        counter, key = ([int(x) for x in rng.integers(0, 2**64 - 1, n, dtype=np.uint64)] for n in (4, 2))
        drawn = np.random.Philox(counter=np.array(counter, dtype=np.uint64), key=np.array(key, dtype=np.uint64))
        # numpy counts up before it draws
        assert philox_of(64, [counter[0] + 1, *counter[1:]], key) == drawn.random_raw(4).tolist()
        counter, key = ([int(x) for x in rng.integers(0, 2**32, n)] for n in (4, 2))
        assert [int(philox(*counter, *key, n)) for n in range(4)] == philox_of(32, counter, key)


NAMES = ("c0", "c1", "c2", "c3", "k0", "k1")
NO_WORDS = (
    math.nan,
    math.inf,
    -math.inf,
    -1.0,
    -0.5,
    0.5,
    2.0**32 - 0.5,
    2.0**32,
    2.0**33 + 1.0,
    2.0**51 + 0.5,
    2.0**52,
    2.0**52 + 7.0,
    2.0**53,
    1e300,
    -1e300,
    5e-324,
    -5e-324,
)


def operands():
    """Words at random and at the ends of their range, then each operand in turn as something that is no word."""
    rng = np.random.default_rng(2)
    x = rng.integers(0, 2**32, (60 + 6 * len(NO_WORDS), 6)).astype(np.float64)
    x[:30] = np.where(rng.random((30, 6)) < 0.5, x[:30], rng.choice([0.0, -0.0, 1.0, 2.0**31, 2.0**32 - 1.0], (30, 6)))
    for i in range(6):
        x[60 + i * len(NO_WORDS) : 60 + (i + 1) * len(NO_WORDS), i] = NO_WORDS
    return x


def words_of(t):
    """All words of what the case brings, and one where most operands are known while it is recorded."""
    given = [t.input(name) for name in NAMES]
    return [philox(*given, n) for n in range(4)] + [philox(given[0], 0.0, given[2], 7.0, 3.0, 0.0, 1)]


def expected():
    x = operands()
    return np.array(
        [
            [PLAIN["philox"](*row, n) for n in range(4)] + [PLAIN["philox"](row[0], 0.0, row[2], 7.0, 3.0, 0.0, 1)]
            for row in x.tolist()
        ]
    )


@pytest.fixture(scope="module")
def recording():
    def body(t):
        for i, word in enumerate(words_of(t)):
            t.output(f"w{i}", word)

    return record(Program(1.0, (), (), (RunPhase(Phase("draw", body)),), NAMES, 0, tuple(f"w{i}" for i in range(5))))


def test_what_is_no_word_gives_no_number():
    wanted = expected()
    assert np.isnan(wanted[60:, :4]).all() and not np.isnan(wanted[:60]).any()
    assert math.isnan(philox(0.0, 0.0, 0.0, 0.0, 0.0, math.nan, 2))


def test_arrays_have_the_bits_of_plain_numbers():
    columns, wanted = operands().T, expected()
    for n in range(4):
        assert np.array_equal(ARRAYS["philox"](*columns, n), wanted[:, n], equal_nan=True)
    assert np.array_equal(philox(columns[0], 0.0, columns[2], 7.0, 3.0, 0.0, 1), wanted[:, 4], equal_nan=True)


@pytest.mark.release
@pytest.mark.parametrize("lanes", [2, 4, 8, 16, 32])
@pytest.mark.parametrize("cpu", [None, *RUNNABLE])
def test_machine_code_has_the_bits_of_plain_numbers(recording, cpu, lanes):
    for level in (0, 1, 2, 3):
        _, outputs = kernel.from_recording(recording, lanes, cpu, level=level).run(operands(), 0)
        assert np.array_equal(outputs, expected(), equal_nan=True)


def test_words_that_fall_into_different_pieces_are_the_same(recording):
    machine = llvm.machine()
    text = emit(recording, 8, above=1, shortest=1, longest=1)
    assert text.count("define private void @section.0.") > 3
    loaded = llvm.Loaded(llvm.assemble(text, machine), machine)
    _, outputs = kernel.LlvmKernel(recording, 8, machine, loaded, False).run(operands(), 0)
    assert np.array_equal(outputs, expected(), equal_nan=True)


@pytest.mark.parametrize("cpu", ["haswell", "skylake-avx512"])
def test_four_words_take_twenty_short_products(cpu):
    def body(t):
        for n in range(4):
            t.output(f"w{n}", philox(*(t.input(name) for name in NAMES), n))

    program = Program(1.0, (), (), (RunPhase(Phase("draw", body)),), NAMES, 0, ("w0", "w1", "w2", "w3"))
    machine = llvm.machine(cpu)
    text = llvm.listing(emit(record(program), machine.width, width=machine.width), machine)
    assert text.count("vpmuludq") == 20 and "vpmullq" not in text


def test_known_operands_give_known_words():
    graph = Graph()
    zero = graph.input("x") * 0.0
    word = philox(zero, zero, zero, zero, zero, zero, 2)
    assert graph.value(word.ref) == 0xBC57AC4C
    assert graph.value(philox(zero - 1.0, zero, zero, zero, zero, zero, 2).ref) != graph.value(word.ref)


def test_formulas_with_words_survive_json_and_replay_alike():
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    formulas = Formulas.of(graph, [philox(x, y, 3.0, -x, y, y + 1.0, n) * 2.0 for n in (0, 3)])
    formulas = Formulas(**json.loads(json.dumps(vars(formulas), allow_nan=False)))
    x, y = np.array([0.0, 0.0, -0.0, 1.0]), np.array([5.0, 2.0**32 - 2.0, 0.0, 0.0])
    at_once = np.array(formulas.replay({"x": x, "y": y}))
    assert np.array_equal(np.isnan(at_once), [[False, False, False, True]] * 2)  # -1 is no word
    again = Graph()
    spliced = Formulas.of(again, formulas.replay({"x": again.input("x"), "y": again.input("y")}))
    for i in range(4):
        one = {"x": float(x[i]), "y": float(y[i])}
        assert np.array_equal(formulas.replay(one), at_once[:, i], equal_nan=True)
        assert np.array_equal(spliced.replay(one), at_once[:, i], equal_nan=True)
