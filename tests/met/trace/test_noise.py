"""Noise: what a draw is made of, how it is spread, and that it depends on its own place alone."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
from scipy import special, stats

from met.backends.llvm import kernel
from met.backends.reference.plain import execute
from met.trace.noise import Stream, channel_number, normal, normal_pair, uniform, uniform_pair
from met.trace.primitives import PLAIN
from met.trace.program import Every, Phase, Program, RecordPhase, RunPhase
from tests.instruction_sets import RUNNABLE

# A generator without a flaw fails a comparison of statistics at this rate, and one of the five hundred below with a
# chance of half a percent. Seeds are fixed: what passes once passes always.
UNLIKELY = 1e-5


def program(draw, inputs=("seed", "repeat", "gain"), columns=1):
    """One row a tick: `draw(tape)` gives its columns."""

    def row(t):
        for column, value in enumerate(draw(t)):
            t.record(column, value)

    return Program(1.0, (), (RecordPhase(Phase("row", row), 1),), (), inputs, columns, ())


def stream_of(t, channel="tachometer"):
    return Stream(t.input("seed"), t.input("repeat"), channel)


def drawn(draw, cases, ticks, columns=1, **options):
    """Rows [case, tick, column] of machine code; cases are (seed, repeat, gain)."""
    return kernel.compile(program(draw, columns=columns), **options).run(np.array(cases), ticks - 1)[0]


# What a draw is


def test_a_channels_number_is_the_crc_32_of_its_name():
    assert channel_number("123456789") == 0xCBF43926  # the check value that the definition of CRC-32 comes with
    assert channel_number("") == 0
    rng = np.random.default_rng(4)
    for _ in range(2000):  # no two of a length that differ in up to four neighbouring bytes have one number
        name = bytearray(rng.integers(33, 127, 24).astype(np.uint8))
        other, place = bytearray(name), rng.integers(0, 21)
        other[place : place + 4] = bytes(rng.integers(33, 127, 4).astype(np.uint8))
        assert other == name or channel_number(other.decode()) != channel_number(name.decode())


@pytest.mark.parametrize(
    ("seed", "repeat", "tick"),
    [(0, 0, 0), (7, 3, 12), (2**32, 0, 2**32), (2**53, 2**32 - 1, 2**53), (2**53 - 1, 5, 2**53 - 1)],
)
def test_a_draw_is_made_of_the_words_that_the_page_says(seed, repeat, tick):
    counter = (tick % 2**32, tick // 2**32, repeat, channel_number("elbow"))
    w = [int(PLAIN["philox"](*map(float, counter), float(seed % 2**32), float(seed // 2**32), n)) for n in range(4)]
    stream = Stream(float(seed), float(repeat), "elbow")
    u, v = uniform_pair(stream, float(tick))
    assert (u, v) == ((w[0] * 2**21 + (w[1] >> 11)) / 2**53, (w[2] * 2**21 + (w[3] >> 11)) / 2**53)
    assert uniform(stream, float(tick)) == u
    a, b = normal_pair(stream, float(tick))
    assert normal(stream, float(tick)) == a
    # an angle of up to 2 pi is rounded to 2^-51
    assert a == pytest.approx(math.sqrt(-2.0 * math.log(u)) * math.cos(2.0 * math.pi * v), rel=1e-15, abs=1e-14)
    assert b == pytest.approx(math.sqrt(-2.0 * math.log(u)) * math.sin(2.0 * math.pi * v), rel=1e-15, abs=1e-14)


def test_neither_end_of_the_interval_is_ever_drawn(monkeypatch):
    stream = Stream(0.0, 0.0, "x")
    for word, expected in ((0.0, 2.0**-54), (2.0**32 - 1.0, 1.0 - 2.0**-53), (2.0**31, 0.5 + 2.0**-33)):
        monkeypatch.setattr("met.trace.functions.philox", lambda *operands, word=word: np.float64(word))
        assert uniform_pair(stream, 0.0) == (expected, expected)
        assert all(math.isfinite(x) and abs(x) < 8.7 for x in normal_pair(stream, 0.0))


@pytest.mark.parametrize(
    ("seed", "repeat", "tick"),
    [
        (math.nan, 0.0, 0.0),
        (0.0, math.nan, 0.0),
        (0.0, 0.0, math.nan),
        (0.5, 0.0, 0.0),
        (0.0, 0.5, 0.0),
        (0.0, 0.0, 0.5),
        (-1.0, 0.0, 0.0),
        (0.0, -1.0, 0.0),
        (0.0, 0.0, -1.0),
        (math.inf, 0.0, 0.0),
        (0.0, 2.0**32, 0.0),
        (0.0, 0.0, 2.0**64),
    ],
)
def test_what_is_no_place_of_a_draw_gives_no_number(seed, repeat, tick):
    def body(t):
        stream = Stream(t.input("seed"), t.input("repeat"), "x")
        for name, value in zip(
            "uvab", uniform_pair(stream, t.input("k")) + normal_pair(stream, t.input("k")), strict=True
        ):
            t.output(name, value)

    one = Program(1.0, (), (), (RunPhase(Phase("end", body)),), ("seed", "repeat", "k"), 0, ("u", "v", "a", "b"))
    assert np.isnan(kernel.compile(one).run(np.array([[seed, repeat, tick]]), 0)[1]).all()
    assert np.isnan(list(execute(one, [seed, repeat, tick], 0)[1].values())).all()


@pytest.mark.slow
def test_machine_code_draws_what_plain_numbers_draw():
    def draw(t):
        return (*uniform_pair(stream_of(t), t.tick), *normal_pair(stream_of(t), t.tick))

    cases = [(0.0, 0.0, 1.0), (2.0**53, 4.0, 1.0), (12345678901.0, 2.0**32 - 1.0, 1.0)]
    rows = drawn(draw, cases, 200, columns=4)
    plain = np.array([execute(program(draw, columns=4), case, 199)[0] for case in cases])
    assert np.array_equal(rows[:, :, :2], plain[:, :, :2])
    # logarithm, root, sine and cosine are each a few units off, and deviates at most 8.7
    np.testing.assert_allclose(rows[:, :, 2:], plain[:, :, 2:], rtol=0.0, atol=8e-15)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("lanes", "cpu", "level"),
    [(2, None, 2), (4, RUNNABLE[0], 2), (16, None, 3), (32, RUNNABLE[0], 0), (8, RUNNABLE[-1], 1)],
)
def test_draws_have_the_same_bits_whatever_they_are_compiled_for(lanes, cpu, level):
    def draw(t):
        return normal_pair(stream_of(t), t.tick)

    cases = [(float(i), float(i % 3), 1.0) for i in range(37)]
    assert drawn(draw, cases, 50, 2, lanes=lanes, cpu=cpu, level=level).tobytes() == drawn(draw, cases, 50, 2).tobytes()


# On what a draw depends


def test_cases_that_differ_in_a_gain_feel_the_same_noise_and_repeats_another():
    rows = drawn(
        lambda t: (normal(stream_of(t), t.tick), t.input("gain") * normal(stream_of(t), t.tick)),
        [(7.0, 0.0, 1.0), (7.0, 0.0, 2.0), (7.0, 1.0, 1.0), (8.0, 0.0, 1.0)],
        100,
        columns=2,
    )
    assert np.array_equal(rows[0, :, 0], rows[1, :, 0]) and np.array_equal(2.0 * rows[0, :, 1], rows[1, :, 1])
    for other in rows[2:]:
        assert not (other[:, 0] == rows[0, :, 0]).any()


@pytest.mark.slow
def test_another_channel_or_another_order_changes_no_draw():
    alone = drawn(lambda t: [normal(stream_of(t), t.tick)], [(1.0, 2.0, 0.0)], 50)
    among = drawn(
        lambda t: [normal(stream_of(t, name), t.tick) for name in ("zero", "tachometer", "last")],
        [(1.0, 2.0, 0.0)],
        50,
        columns=3,
    )
    assert np.array_equal(among[:, :, 1], alone[:, :, 0])
    for one, other in combinations(range(3), 2):
        assert not (among[:, :, one] == among[:, :, other]).any()


def test_a_draw_belongs_to_its_tick_however_the_run_gets_there():
    every = drawn(lambda t: [normal(stream_of(t), t.tick)], [(1.0, 2.0, 0.0)], 60)[0, :, 0]
    k = kernel.compile(program(lambda t: [normal(stream_of(t), t.tick)]))
    block = k.block([[1.0, 2.0, 0.0]])
    assert np.array_equal(block.recorded(40, 59)[0, :, 0], every[40:])
    assert np.array_equal(block.recorded(10, 19)[0, :, 0], every[10:20])
    draw = Phase("draw", lambda t: t.write("x", normal(stream_of(t), t.tick)))
    show = Phase("show", lambda t: t.output("x", t.read("x")))
    slower = Program(1.0, (), (Every(7, (RunPhase(draw),)),), (RunPhase(show),), ("seed", "repeat", "gain"), 0, ("x",))
    assert [kernel.compile(slower).run(np.array([[1.0, 2.0, 0.0]]), n)[1][0, 0] for n in (0, 6, 7, 59)] == [
        every[0],
        every[0],
        every[7],
        every[56],
    ]


# How draws are spread


CASES, TICKS = 512, 4096


@pytest.fixture(scope="module")
def deviates():
    """Two million pairs, [repeat, tick, which]."""
    return drawn(lambda t: normal_pair(stream_of(t), t.tick), [(0.0, float(i), 0.0) for i in range(CASES)], TICKS, 2)


def likely(score):
    """Whether a score of mean 0 and variance 1 is likely to come of normal noise."""
    return abs(score) < stats.norm.isf(UNLIKELY / 2)


@pytest.mark.slow
def test_moments_are_those_of_the_normal_distribution(deviates):
    x = deviates.ravel()
    # variances of the means of x, x^2, x^3 and x^4 are 1, 2, 15 and 96 over their number
    for power, mean, variance in ((1, 0.0, 1.0), (2, 1.0, 2.0), (3, 0.0, 15.0), (4, 3.0, 96.0)):
        assert likely((np.mean(x**power) - mean) / math.sqrt(variance / x.size)), power


@pytest.mark.slow
@pytest.mark.parametrize("which", [0, 1])
def test_deviates_are_normal_by_kolmogorov_smirnov_and_by_anderson_darling(deviates, which):
    x = np.sort(deviates[:, :, which].ravel())
    assert stats.kstest(x, "norm").pvalue > UNLIKELY
    # A^2 for a distribution that is wholly given: above 6 once in a thousand, its tail falls as exp(-A^2)
    n = x.size
    a = -n - np.mean((2.0 * np.arange(1, n + 1) - 1.0) * (special.log_ndtr(x) + special.log_ndtr(-x[::-1])))
    assert a < 6.0 - math.log(UNLIKELY / 1e-3)


@pytest.mark.slow
def test_tails_hold_as_many_as_they_should_up_to_five_sigma(deviates):
    counts = np.zeros(4)
    total = 0
    for seed in range(8):
        x = (
            deviates
            if seed == 0
            else drawn(
                lambda t: normal_pair(stream_of(t), t.tick),
                [(float(seed), float(i), 0.0) for i in range(CASES)],
                TICKS,
                2,
            )
        )
        counts += [np.count_nonzero(np.abs(x) > limit) for limit in (2.0, 3.0, 4.0, 5.0)]
        total += x.size
    for limit, count in zip((2.0, 3.0, 4.0, 5.0), counts, strict=True):
        expected = 2.0 * stats.norm.sf(limit) * total
        assert stats.poisson.sf(count - 1, expected) > UNLIKELY and stats.poisson.cdf(count, expected) > UNLIKELY, limit
    assert counts[3] > 5  # of 33 million, 19 are expected


@pytest.mark.slow
def test_uniform_deviates_are_uniform():
    u = drawn(lambda t: uniform_pair(stream_of(t), t.tick), [(3.0, float(i), 0.0) for i in range(256)], TICKS, 2)
    for which in (0, 1):
        x = u[:, :, which].ravel()
        assert x.min() > 0.0 and x.max() < 1.0
        assert stats.kstest(x, "uniform").pvalue > UNLIKELY
        # every bit but the lowest of all 53, which the smallest numbers alone have below 2^-53
        whole = (x * 2.0**53).astype(np.uint64)
        for bit in range(53):
            ones = np.count_nonzero(whole >> np.uint64(bit) & np.uint64(1))
            assert likely((ones - x.size / 2) / math.sqrt(x.size / 4)), bit
        for shift in (0, 8, 21, 37, 45):
            counts = np.bincount((whole >> np.uint64(shift) & np.uint64(255)).astype(int), minlength=256)
            assert UNLIKELY < stats.chisquare(counts).pvalue < 1.0 - UNLIKELY, shift
    pairs = np.histogram2d(u[:, :, 0].ravel(), u[:, :, 1].ravel(), bins=32, range=[[0, 1], [0, 1]])[0]
    assert UNLIKELY < stats.chisquare(pairs.ravel()).pvalue < 1.0 - UNLIKELY


def independent(x, y):
    """Whether two sets of normal deviates, and their squares, are uncorrelated."""
    n = x.size
    return likely(np.sum(x * y) / math.sqrt(n)) and likely(np.sum((x * x - 1.0) * (y * y - 1.0)) / (2.0 * math.sqrt(n)))


@pytest.mark.slow
def test_the_two_of_a_pair_and_neighbours_in_time_and_repeat_are_independent(deviates):
    a, b = deviates[:, :, 0], deviates[:, :, 1]
    assert independent(a, b)
    for lag in (1, 2, 3, 8, 256):
        assert independent(a[:, lag:], a[:, :-lag]) and independent(a[lag:], a[:-lag]), lag
        assert independent(a[:, lag:], b[:, :-lag]) and independent(a[lag:], b[:-lag]), lag


@pytest.mark.slow
def test_channels_and_seeds_are_independent_of_each_other():
    names = ("a", "b", "joint1.servo.tachometer", "joint2.servo.tachometer")
    x = drawn(
        lambda t: [normal(stream_of(t, name), t.tick) for name in names],
        [(seed, float(i), 0.0) for seed in (0.0, 1.0, 2.0**32, 2.0**53) for i in range(64)],
        TICKS,
        len(names),
    )
    by_seed = x.reshape(4, 64, TICKS, len(names))
    for one, other in combinations(range(4), 2):
        assert independent(by_seed[:, :, :, one], by_seed[:, :, :, other])
        assert independent(by_seed[one], by_seed[other])


def test_a_changed_bit_of_any_operand_changes_half_of_all_bits():
    rng = np.random.default_rng(5)
    operands = [float(x) for x in rng.integers(0, 2**32, 6)]
    before = [int(PLAIN["philox"](*operands, n)) for n in range(4)]
    changed = np.zeros(128)
    for i in range(6):
        for bit in range(32):
            other = list(operands)
            other[i] = float(int(operands[i]) ^ 1 << bit)
            turned = [int(PLAIN["philox"](*other, n)) ^ before[n] for n in range(4)]
            ones = [word >> place & 1 for word in turned for place in range(32)]
            assert likely((sum(ones) - 64) / math.sqrt(32)), (i, bit)
            changed += ones
    assert all(likely((count - 96) / math.sqrt(48)) for count in changed)
