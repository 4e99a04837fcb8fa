"""The moves for identifying a bed, and what leads it through them."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence

import numpy as np

from hw.identify.moves import GROUPS, STILL, Move, MoveGuide, Peaks, groups, guided


def test_each_group_of_moves_has_all_kinds() -> None:
    moves = guided(100.0)
    its = groups(moves)
    kinds = {move.name for move in moves}
    assert all({move.name for move, group in zip(moves, its, strict=True) if group == one} == kinds for one in set(its))


def test_a_slew_that_is_small_is_kept() -> None:
    guide = MoveGuide(guided(100.0), Peaks(10.0, 1.0, 500.0), 1e-3, (500.0, 50.0))
    told, before = [[0.0, 0.0]], (0.0, 0.0)
    for e in range(3000):
        guide(e, [0.0], told)
        assert abs(told[0][0] - before[0]) <= 0.5 + 1e-12 and abs(told[0][1] - before[1]) <= 0.05 + 1e-12
        before = (told[0][0], told[0][1])
    assert before != (0.0, 0.0)


def test_a_move_is_over_where_the_shaft_is_too_fast() -> None:
    guide = MoveGuide(guided(100.0), Peaks(10.0, 1.0, 50.0), 1e-3, (1e5, 1e5))
    told = [[0.0, 0.0]]
    for e in range(81):
        guide(e, [0.0], told)
    assert told == [[1.5, 0.0]]
    guide(81, [50.1], told)
    assert told == [[0.0, 0.0]]


def test_a_shaft_that_does_not_come_to_rest_is_found_out() -> None:
    guide = MoveGuide(guided(100.0), Peaks(10.0, 1.0, 50.0), 1e-3, (1e5, 1e5))
    for e in range(3001):
        guide(e, [3.0], [[0.0, 0.0]])
    assert guide.stuck and not guide.began


TOP = 100.0


def told(move: Move, rates: Sequence[float]) -> np.ndarray:
    """Voltage and current of a move at 97 instants of it, as shares of the peaks; rates: of the shaft, rad/s, by
    turns."""
    profile = move.profile()
    return np.array([profile(t, rates[n % len(rates)]) for n, t in enumerate(np.linspace(0.0, move.time, 97)[:-1])])


def test_moves_of_every_kind_keep_within_the_peaks() -> None:
    """And there are as many of a kind as groups, or more."""
    moves = guided(TOP)
    counts = Counter(move.name for move in moves)
    assert list(counts) == ["steps", "loaded", "slow", "limited", "mixed"] and min(counts.values()) >= GROUPS
    for move in moves:
        assert 0.1 < np.abs(told(move, (0.0, TOP, 0.0, -TOP))).max() <= 1.0, move


def test_each_move_but_the_mixed_ones_has_its_mirror_image() -> None:
    rates = (0.0, 0.35 * TOP, 0.7 * TOP, TOP, 0.7 * TOP, 0.35 * TOP)
    for name in ("steps", "loaded", "slow", "limited"):
        its = [move for move in guided(TOP) if move.name == name]
        there = {(told(move, rates).round(12) + 0.0).tobytes() for move in its}
        back = {(0.0 - told(move, [-rate for rate in rates]).round(12)).tobytes() for move in its}
        assert there == back, name


def test_slow_moves_are_whole_waves() -> None:
    """They end at 0 V and 0 A, where they began."""
    for move in guided(TOP):
        if move.name == "slow":
            profile = move.profile()
            np.testing.assert_allclose([profile(0.0, 0.0), profile(move.time, 0.0)], 0.0, atol=1e-12)


def test_limited_moves_drive_up_to_one_rate_and_coast_down_to_a_lower_one() -> None:
    for move in guided(TOP):
        if move.name != "limited":
            continue
        profile, up, down = move.profile(), np.linspace(0.0, TOP, 401), np.linspace(TOP, 0.0, 401)
        sign = profile(0.0, 0.0)[0]
        drives_up = [profile(0.0, sign * rate)[0] == sign for rate in up]
        drives_down = [profile(0.0, sign * rate)[0] == sign for rate in down]
        ends, begins = up[drives_up.index(False)], down[drives_down.index(True)]
        assert abs(sign) == 1.0 and 0.2 * TOP < begins < 0.8 * ends and ends <= TOP
        assert all(drives_up[: drives_up.index(False)]) and not any(drives_up[drives_up.index(False) :])


def test_a_shaft_at_rest_is_led_through_all_moves() -> None:
    """Each begins once it has rested for long enough after the last."""
    period, moves = 1.0 / 64.0, guided(TOP)
    guide, commands = MoveGuide(moves, Peaks(10.0, 1.0, 50.0), period, (1e5, 1e5)), [[0.0, 0.0]]
    exchanges = 0
    while not guide.done and not guide.stuck:
        guide(exchanges, [0.0], commands)
        exchanges += 1
    rest = math.ceil(STILL / period)
    begin = rest - 1
    for move, began in zip(moves, guide.began, strict=True):
        assert began == begin
        begin += math.ceil(move.time / period - 1e-6) + rest
    assert guide.done and exchanges == begin + 1 <= guide.exchanges and commands == [[0.0, 0.0]]
