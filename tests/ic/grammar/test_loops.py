"""Loops and several names at once: the entries that they stand for, and the places of these.

Their messages, whole, are in `tests/ic/messages/loops.txt`.
"""

from __future__ import annotations

import json
import random
from dataclasses import fields, is_dataclass
from typing import Any

import pytest

from ic.formatting.formatter import formatted
from ic.grammar.syntax import Group, Let
from ic.read import read
from met.diagnostic import Place
from met.messages.programs import to_json
from tests.ic.decktext import Desk


def bare(node: Any) -> Any:
    """A part of the tree without places."""
    if isinstance(node, tuple):
        return tuple(bare(each) for each in node)
    if not is_dataclass(node):
        return node
    values = {field.name: getattr(node, field.name) for field in fields(node)}
    kept = {name: bare(value) for name, value in values.items() if not isinstance(value, Place)}
    return type(node).__name__, tuple(kept.items())


def same(desk: Desk, one: str, other: str) -> bool:
    """Whether two texts have one tree."""
    return bool(bare(desk.read(one).entries) == bare(desk.read(other).entries))


@pytest.mark.parametrize(("loop", "plain"), [
    ("for i in 1 .. 3 { let a_{i} = i * 2 m; }", "let a_1 = 1 * 2 m; let a_2 = 2 * 2 m; let a_3 = 3 * 2 m;"),
    ("for i in 1 .. 5 by 2 { let a{i}b = 3; }", "let a1b = 3; let a3b = 3; let a5b = 3;"),
    ("for i in 3 .. 1 by -2 { let a{i} = i; }", "let a3 = 3; let a1 = 1;"),
    ("for i in 4 .. 4 { let a{i} = i kg; }", "let a4 = 4 kg;"),
    ("for i in 1 .. 0 { let a{i} = i; }", ""),
    ("for i in 2 .. 3 { let a{i-1}_{i*i} = 1; }", "let a1_4 = 1; let a2_9 = 1;"),
    ("for i in 7 .. 8 { let a{i/(8-7)}_{i%2}{(i-7)*4} = 1; }", "let a7_10 = 1; let a8_04 = 1;"),
    ("for side in [left, right] { let {side}_x = 1; }", "let left_x = 1; let right_x = 1;"),
    ("for i in 1 .. 2 { let a_{ i } = b_{ i - 1 }.x; let c{ i } = 0; }",
     "let a_1 = b_0.x; let c1 = 0; let a_2 = b_1.x; let c2 = 0;"),
    ("for s_ in [p, q] { let {s_}_x = t.{ s_ }.mass; }", "let p_x = t.p.mass; let q_x = t.q.mass;"),
    ("for s_ in [p, q] { let { s_ }_x = t_{ s_ }_{ s_ }; }", "let p_x = t_p_p; let q_x = t_q_q;"),
    ("for n in [3, 1 + 1] { let a{n} = 1; }", "let a3 = 1; let a2 = 1;"),
    ("arm a { for s_ in [p, q] { joint {s_} revolute { parent = s_;  child = {s_}; } } }",
     "arm a { joint p revolute { parent = p;  child = p; } joint q revolute { parent = q;  child = q; } }"),
    ("run r { for j in [a, b] { record += [j.q, {j}.qd, x_{j}.tau]; {j}.q = 3 deg; } }",
     "run r { record += [a.q, a.qd, x_a.tau]; a.q = 3 deg; record += [b.q, b.qd, x_b.tau]; b.q = 3 deg; }"),
    ("for i in 0 .. 1 { for j in i .. 1 { let a{i}_{j} = i + j; } }",
     "let a0_0 = 0 + 0; let a0_1 = 0 + 1; let a1_1 = 1 + 1;"),
    ("for a in [u, v] { for b in [a, w] { let {a}_{b} = 1; } }", "let u_u = 1; let u_w = 1; let v_v = 1; let v_w = 1;"),
    ("for i in 1 .. 2 { metric top_{i} = max { of = j_{i}.q; } require top_{i} < i rad; require r{i}: top_{i} < 3; }",
     "metric top_1 = max { of = j_1.q; } require top_1 < 1 rad; require r1: top_1 < 3;"
     "metric top_2 = max { of = j_2.q; } require top_2 < 2 rad; require r2: top_2 < 3;"),
    ("for i in 1 .. 2 { servo s{i} like base_{i} { kp = lengths[i - 1]; } }",
     "servo s1 like base_1 { kp = lengths[1 - 1]; } servo s2 like base_2 { kp = lengths[2 - 1]; }"),
    # what is no index in a value stays: keys, words, paths, arguments' names, strings
    ('for i in 1 .. 1 { x { i = 3;  i { i = f(i = i);  y = z.i;  w = "i {i}"; } } }',
     'x { i = 3;  i { i = f(i = 1);  y = z.i;  w = "i {i}"; } }'),
    ("#define COUNT 2\n#define SEG(n_) link seg_{n_} { }\narm a { for i in 1 .. COUNT { SEG(i) } }",
     "arm a { link seg_1 { } link seg_2 { } }"),
    ("run r { servos { [lift, swing] = turner;  * = spindle; } }",
     "run r { servos { lift = turner;  swing = turner;  * = spindle; } }"),
    ("run r { initial { [lift, swing].q = 3 deg; } [a, b] { kp = 3; } [x.y, z] += [q]; }",
     "run r { initial { lift.q = 3 deg;  swing.q = 3 deg; } a { kp = 3; } b { kp = 3; } x.y += [q]; z += [q]; }"),
])  # fmt: skip
def test_it_is_the_tree_of_what_it_stands_for(desk: Desk, loop: str, plain: str) -> None:
    assert same(desk, loop, plain)


def test_an_entry_of_a_loop_is_placed_where_it_is_written_and_knows_its_iterations_innermost_first(desk: Desk) -> None:
    deck = desk.read(
        "arm a {\n  for i in 1 .. 2 {\n    for side in [x, y] {\n      link l_{i}{side} { }\n    }\n  }\n}"
    )
    arm = deck.entries[0]
    assert isinstance(arm, Group)
    places = [link.words[1].place for link in arm.body if isinstance(link, Group)]
    assert {(place.line, place.column, place.length, place.macros) for place in places} == {(4, 12, 11, ())}
    assert [[str(iteration) for iteration in place.iterations] for place in places] == [
        ["side = x", "i = 1"],
        ["side = y", "i = 1"],
        ["side = x", "i = 2"],
        ["side = y", "i = 2"],
    ]
    assert [(iteration.use.line, iteration.use.column) for iteration in places[0].iterations] == [(3, 5), (2, 3)]


def test_the_index_in_a_value_is_placed_where_it_stands(desk: Desk) -> None:
    let = desk.read("for i in 7 .. 7 { let a_{i} = i; }").entries[0]
    assert isinstance(let, Let)
    assert (let.value.place.column, let.value.place.length) == (31, 1)


def test_a_loop_in_a_macro_and_a_macro_in_a_loop_keep_both(desk: Desk) -> None:
    text = "#define ONE let a_{i} = 3;\n#define ALL for i in 1 .. 1 { ONE }\nALL\nfor i in 2 .. 2 { ONE }"
    first, second = desk.read(text).entries
    for entry, macros in ((first, ["ONE", "ALL"]), (second, ["ONE"])):
        assert [step.macro for step in entry.place.macros] == macros
        assert [str(iteration) for iteration in entry.place.iterations] == [f"i = {'1' if entry is first else '2'}"]


def test_programs_are_told_the_iterations_beside_the_macros(desk: Desk) -> None:
    desk.write("for i in 1 .. 2 { let a_{i} = 3 mm + i; let a_{i} = 1 kgg; }")
    found = read("a.ic", despite_errors=True).warnings
    place = json.loads(to_json(found))["diagnostics"][0]["at"]["place"]
    assert "expansions" not in place
    assert [(each["index"], each["value"], each["loop"]["line"]) for each in place["iterations"]] == [("i", "1", 1)]


def test_two_mistakes_of_one_iteration_are_two_and_one_of_two_iterations_is_one(desk: Desk) -> None:
    assert desk.codes("for i in 1 .. 9 {\n let a_{i} = 1 kgg;\n let b_{i} = 1 kgg; }") == ["D028:2", "D028:3"]


def test_for_may_still_be_a_name(desk: Desk) -> None:
    assert same(
        desk, "for = 3; for { in = 3; } link for { } x = for;", "for = 3;\nfor { in = 3; }\nlink for { }\nx = for;"
    )


def flattened(pick: random.Random, depth: int = 0) -> tuple[str, list[str]]:
    """A loop whose block has settings and loops, and the settings of all its iterations as they are without it."""
    index = f"i{depth}"
    low, high = sorted(pick.randint(0, 6) for _ in range(2))
    step = pick.choice([1, 1, 2, 3])
    iterations = range(low, high + 1, step)
    parts: list[str] = []
    made: dict[int, list[str]] = {iteration: [] for iteration in iterations}
    for n in range(pick.randint(1, 3)):
        name = f"v{depth}_{n}_{pick.randint(0, 999)}"
        parts.append(f"{name}_{{{index}+3}} = {index} - 2;")
        for iteration in iterations:
            made[iteration].append(f"{name}_{iteration + 3} = {iteration} - 2;")
        if depth < 3 and pick.random() < 0.4:
            text, lines = flattened(pick, depth + 1)
            parts.append(text)
            for iteration in iterations:
                made[iteration] += lines
    head = f"for {index} in {low} .. {high}" + (f" by {step}" if step > 1 or pick.random() < 0.3 else "")
    return f"{head} {{ {' '.join(parts)} }}", [line for iteration in iterations for line in made[iteration]]


@pytest.mark.release
@pytest.mark.parametrize("seed", range(40))
def test_random_loops_are_what_they_stand_for_and_stay_so_laid_out(desk: Desk, seed: int) -> None:
    text, lines = flattened(random.Random(seed))
    assert lines and same(desk, text, "\n".join(lines))
    laid = formatted("a.ic", text)
    assert formatted("a.ic", laid) == laid
    assert same(desk, text, laid)


@pytest.mark.parametrize(("text", "laid"), [
    ("for i in   1..499   by  2{\nlink seg_{i}   {mass=1 kg;}\n}\n",
     "for i in 1 .. 499 by 2 {\n    link seg_{i} { mass = 1 kg; }\n}\n"),
    ("for i in -3..3{\nlet a_{i+4}=i*2 m;\n}\n", "for i in -3 .. 3 {\n    let a_{i+4} = i * 2 m;\n}\n"),
    ("for side in [ left,right ]{\n{side}_j.q=lengths[ i ];\n}\n",
     "for side in [left, right] {\n    {side}_j.q = lengths[i];\n}\n"),
    ("for i in 0 .. 1 {\nlet a_{ i+1 } = b_{ i }.x;\nlink{ mass=1 kg; }\n}\n",
     "for i in 0 .. 1 {\n    let a_{i+1} = b_{i}.x;\n    link { mass = 1 kg; }\n}\n"),
    ("servos {\na = b { x = 3; }\n* =spindle;\n[lift,swing]=turner;\n}\n",
     "servos {\n    a = b { x = 3; }\n    * = spindle;\n    [lift, swing] = turner;\n}\n"),
])  # fmt: skip
def test_loops_and_lists_of_names_are_laid_out(text: str, laid: str) -> None:
    assert formatted("a.ic", text) == laid
    assert formatted("a.ic", laid) == laid
