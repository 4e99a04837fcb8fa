"""The moves for identifying a bed, and what leads it through them."""

from __future__ import annotations

from hw.identify.moves import MoveGuide, Peaks, groups, guided


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
