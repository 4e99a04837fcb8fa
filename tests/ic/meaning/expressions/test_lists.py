"""Arithmetic of vectors and lists, number by number; components; whole numbers and signs."""

from __future__ import annotations

import math
import random
from pathlib import Path

import numpy as np
import pytest

import ic
from tests.ic.meaning.expressions.test_values import code, number, numbers
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, experiment, messages
from tests.ic.sweeps.test_axes import rows, values

V = "let v = [1.5, -2, 0.25] m;\nlet w = [10, 20, 30] cm;\nlet n = 4;"


@pytest.mark.parametrize(
    ("expression", "si"),
    [
        ("[1, 2, 3] m * 2", [2.0, 4.0, 6.0]),
        ("2 * [1, 2, 3] m", [2.0, 4.0, 6.0]),
        ("[1, 2, 3] * 2 cm", [0.02, 0.04, 0.06]),
        ("([1, 2, 3] * 2) cm", [0.02, 0.04, 0.06]),
        ("[1, 2] m / (4 s)", [0.25, 0.5]),
        ("-[1, 2, 3] m", [-1.0, -2.0, -3.0]),
        ("+[1, 2, 3] m", [1.0, 2.0, 3.0]),
        ("[1, 2] m - [1, 2] cm", [0.99, 1.98]),
        ("[1, 2] + [3, 4] * 2 - [5, 5]", [2.0, 5.0]),
        ("[1 .. 3 by 1, 10] kg * 2", [2.0, 4.0, 6.0, 20.0]),
        ("linspace(0, 1, 3) m + [1, 1, 1] m", [1.0, 1.5, 2.0]),
        ("[1 m, 2 s] * 2", [2.0, 4.0]),
    ],
)
def test_lists_are_computed_number_by_number(tmp_path: Path, expression: str, si: list[float]) -> None:
    assert numbers(tmp_path, expression) == pytest.approx(si, rel=4e-16)


@pytest.mark.slow
def test_each_number_has_the_bits_of_the_same_arithmetic_on_numbers(tmp_path: Path) -> None:
    pick = random.Random(7)
    for _ in range(60):
        a, b = ([round(pick.uniform(-9, 9), pick.randrange(5)) for _ in range(3)] for _ in range(2))
        k = round(pick.uniform(0.1, 9), 3)
        made = numbers(tmp_path, f"{k} * {a} mm / 7 + -{b} cm * {k}".replace("--", "- -"))
        assert made == [number(tmp_path, f"{k} * ({x} mm) / 7 + -({y} cm) * {k}") for x, y in zip(a, b, strict=True)]


Written = tuple[str, str]
"""An expression as a deck has it, and for numpy."""


def random_number(pick: random.Random, depth: int) -> Written:
    kind = pick.randrange(5) if depth else pick.randrange(2)
    if kind == 0:
        plain = repr(round(pick.uniform(0.1, 4), pick.randrange(4)))
        return plain, plain
    if kind == 1:
        name, axis = pick.choice("vw"), pick.randrange(3)
        return f"{name}.{'xyz'[axis]}", f"{name}[{axis}]"
    if kind == 2:
        word = pick.choice(("floor", "ceil", "sign", "abs"))
        deck, numpy = random_number(pick, depth - 1)
        return f"{word}({deck})", f"np.{word}({numpy})"
    (a, x), (b, y) = random_number(pick, depth - 1), random_number(pick, depth - 1)
    sign = pick.choice("+-*")
    return f"({a}) {sign} ({b})", f"({x}) {sign} ({y})"


def random_vector(pick: random.Random, depth: int) -> Written:
    kind = pick.randrange(6) if depth else pick.randrange(2)
    if kind == 0:
        name = pick.choice("vw")
        return name, name
    if kind == 1:
        parts = [random_number(pick, max(depth - 1, 0)) for _ in range(3)]
        return f"[{', '.join(a for a, _ in parts)}]", f"np.array([{', '.join(b for _, b in parts)}])"
    deck, numpy = random_vector(pick, depth - 1)
    if kind == 2:
        return f"-({deck})", f"-({numpy})"
    if kind == 3:
        other, too = random_vector(pick, depth - 1)
        sign = pick.choice("+-")
        return f"({deck}) {sign} ({other})", f"({numpy}) {sign} ({too})"
    factor, also = random_number(pick, depth - 1)
    if kind == 4:
        return f"({factor}) * ({deck})", f"({also}) * ({numpy})"
    return f"({deck}) / (3 + abs({factor}))", f"({numpy}) / (3 + np.abs({also}))"


@pytest.mark.slow
def test_random_arithmetic_of_vectors_is_that_of_numpy(tmp_path: Path) -> None:
    named = {"v": np.array([1.5, -2.0, 0.25]), "w": np.array([0.1, 0.2, 0.3])}
    lets = "".join(f"let {name} = {values.tolist()};\n" for name, values in named.items())
    for seed in range(150):
        deck, numpy = random_vector(random.Random(seed), 4)
        made = eval(numpy, {"np": np}, named)
        assert numbers(tmp_path, deck, lets) == made.tolist(), (seed, deck)


def test_a_component_is_the_number_of_that_name(tmp_path: Path) -> None:
    assert number(tmp_path, "v.x - v.y + 2 * w.z", V) == pytest.approx(4.1, rel=1e-15)
    assert number(tmp_path, "both.z", V + "\nlet both = v + w;") == pytest.approx(0.55, rel=1e-15)


def test_a_servo_of_the_name_comes_before_a_component(tmp_path: Path) -> None:
    servo = "servo v { model = ideal; x = 3 m; }\n"
    assert number(tmp_path, "v.x", servo + V) == 3.0


def test_that_a_servo_hides_the_components_of_a_vector_is_said(tmp_path: Path) -> None:
    deck = "let v = [1, 2, 3] m;\nservo v { model = ideal; bandwidth = 4 1/s; }\nlet far = v.x;\n"
    assert (
        messages(check(tmp_path, deck))
        == """\
error[D065]: servo `v` writes no `x`
 --> deck.ic:3:11
  |
3 | let far = v.x;
  |           ^^^
 ::: deck.ic:1:5  `let v`
  = help: it hides the components of `let v`: give one of the two another name
  = help: it writes: model, bandwidth

1 error
"""
    )


@pytest.mark.parametrize(
    ("expression", "wanted"),
    [
        ("v * w", "D071"),
        ("v / w", "D071"),
        ("v + 1 m", "D071"),
        ("1 m - v", "D071"),
        ("1 / v", "D071"),
        ("v ^ 2", "D071"),
        ("2 ^ v", "D071"),
        ("v + [1, 2] m", "D071"),
        ("v + [1, 2, 3] s", "D063"),
        ("v + [1, 2, 3]", "D063"),
        ("v / 0", "D066"),
        ("v * 1e308 * 1e10", "D067"),
        ("[[1, 2], 3] * 2", "D071"),
        ("n.x", "D071"),
        ("pair.x", "D071"),
        ("v.q", "D065"),
        ("abs(v)", "D071"),
        ("v < w", "D064"),
    ],
)
def test_what_has_no_meaning_is_refused(tmp_path: Path, expression: str, wanted: str) -> None:
    assert code(tmp_path, expression, V + "\nlet pair = [1, 2] m;") == wanted


def test_the_message_of_two_lists_that_do_not_go_together(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, "let a = [1, 2] m + [1, 2, 3] m;\n"))
        == """\
error[D071]: `+` of 2 numbers and 3
 --> deck.ic:1:18
  |
1 | let a = [1, 2] m + [1, 2, 3] m;
  |                  ^
 ::: deck.ic:1:9  a list
 ::: deck.ic:1:20  a list
  = help: lists are added and subtracted number by number, so both have as many

1 error
"""
    )
    assert (
        messages(check(tmp_path, "let a = [1, 2, 3] * [1, 2, 3];\n"))
        == """\
error[D071]: `*` of two lists
 --> deck.ic:1:19
  |
1 | let a = [1, 2, 3] * [1, 2, 3];
  |                   ^
 ::: deck.ic:1:9  a list
 ::: deck.ic:1:21  a list
  = help: write what is meant number by number: `[a.x * b.x, a.y * b.y, a.z * b.z]`, or their sum

1 error
"""
    )


def test_a_vector_parameter_may_be_computed_and_where_its_unit_is_missing_that_is_said_of_the_whole(
    tmp_path: Path,
) -> None:
    bar = "shape = rod(length = 1 m, along = x);"
    written = changed(ARM, (bar, "com = [1, 2, 3] m / 4; inertia = [1, 1, 1] kg*m^2 * 2;"))
    found = experiment(tmp_path, written, SERVO, RUN)
    assert [found.parameters[f"links.bar.com.{axis}"].value for axis in "xyz"] == [0.25, 0.5, 0.75]
    bare = changed(ARM, (bar, "com = -[1, 2, 3] / 4; inertia = [1, 1, 1] kg*m^2;"))
    assert (
        messages(check(tmp_path, bare, SERVO, RUN))
        == """\
error[D060]: `com` of link `bar` is in m, and these are bare numbers
 --> deck.ic:2:35
  |
2 |     link bar { mass = 2 kg; com = -[1, 2, 3] / 4; inertia = [1, 1, 1] kg*m^2; }
  |                                   ^^^^^^^^^^^^^^
  = help: write `[...] m`: a unit after the bracket is for all of them

1 error
"""
    )


def test_what_a_vector_is_computed_from_varies_with_the_bits_that_each_value_has_alone(tmp_path: Path) -> None:
    lets = "let a = [0.1, 0.2, 0.3] m;\nlet k = 3;\nlet c = a * k / 7 - [1, 1, 1] mm;\n"
    arm = changed(ARM, ("shape = rod(length = 1 m, along = x);", "com = c; inertia = [3, 3, 3] kg*m^2;"))
    sweep = "sweep some of hold { vary k = [1, 2.5] * 3; }\n"
    swept = experiment(tmp_path, lets, arm, SERVO, RUN, sweep, select=["some"])
    assert [row for (row,) in rows(swept)] == [3.0, 7.5]
    for row, k in enumerate((3.0, 7.5)):
        alone = experiment(tmp_path, lets.replace("k = 3", f"k = {k}"), arm, SERVO, RUN)
        for axis in "xyz":
            path = f"links.bar.com.{axis}"
            assert values(swept, path)[row] == alone.parameters[path].value


# Whole numbers and signs


NEAR_HALF = 0.49999999999999994
WHOLE = [0.0, 0.2, 0.5, NEAR_HALF, 1.5, 2.5, -0.2, -0.5, -2.5, 3.0, -3.0, 4503599627370497.5, 1e300, -1e300]


@pytest.mark.parametrize("x", WHOLE)
def test_whole_numbers_near_a_number(tmp_path: Path, x: float) -> None:
    assert number(tmp_path, f"floor({x!r})") == math.floor(x)
    assert number(tmp_path, f"ceil({x!r})") == math.ceil(x)
    away = math.copysign(math.floor(abs(x)) + (abs(x) % 1.0 >= 0.5), x)
    assert number(tmp_path, f"round({x!r})") == away
    assert number(tmp_path, f"sign({x!r})") == np.sign(x)


def test_whole_numbers_of_what_varies_are_those_of_each_value(tmp_path: Path) -> None:
    lets = "let n = 1;\nlet heavy = (40 + 2 * floor(n) + 3 * ceil(n) + round(n) + sign(n)) kg;\n"
    sweep = f"sweep some of hold {{ vary n = [{', '.join(map(repr, WHOLE[1:11]))}]; }}\n"
    arm = changed(ARM, ("2 kg", "heavy"))
    swept = experiment(tmp_path, lets, arm, SERVO, RUN, sweep, select=["some"])
    for row, n in enumerate(WHOLE[1:11]):
        alone = experiment(tmp_path, lets.replace("n = 1;", f"n = {n!r};"), arm, SERVO, RUN)
        assert values(swept, "links.bar.mass")[row] == alone.parameters["links.bar.mass"].value


def test_a_whole_number_is_of_a_pure_number_and_a_sign_of_any(tmp_path: Path) -> None:
    assert number(tmp_path, "round(23 mm / (5 mm)) * 5 mm") == pytest.approx(0.025, rel=1e-15)
    assert number(tmp_path, "sign(-3 mm)") == -1.0
    assert (
        messages(check(tmp_path, "let a = round(23 mm);\n"))
        == """\
error[D061]: `round` of m
 --> deck.ic:1:15
  |
1 | let a = round(23 mm);
  |               ^^^^^
  = help: divide by the step that is meant, and multiply with it: `round(x / (1 mm)) * 1 mm`

1 error
"""
    )


@pytest.mark.parametrize("name", ["floor", "ceil", "round", "sign", "abs", "exp"])
def test_a_deck_may_use_the_name_of_such_a_function_for_a_value(tmp_path: Path, name: str) -> None:
    assert number(tmp_path, f"{name} + 1", f"let {name} = 2;") == 3.0
    servo = changed(SERVO, ("servo drive", f"servo {name}"))
    run = changed(RUN, ("hinge = drive", f"hinge = {name}"))
    assert ic.check(_written(tmp_path, ARM, servo, run)).plan is not None


def _written(folder: Path, *parts: str) -> Path:
    path = folder / "deck.ic"
    path.write_text("".join(parts), encoding="utf-8")
    return path
