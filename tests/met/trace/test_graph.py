"""What the graph does to what it is given: folding, signs, sharing; formulas as data; refusals at the model's line."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from met import trace
from met.diagnostic import Problem
from met.trace import Formulas, Graph, cos, sin, where
from met.trace.nodes import TRUE


@pytest.fixture
def graph():
    return Graph()


def same(a, b):
    return a.ref == b.ref


def test_constants_are_computed_at_once(graph):
    x = graph.input("x")
    two = x * 0.0 + 2.0
    assert graph.value(two.ref) == 2.0
    assert graph.value((two * 3.0 - 1.0).ref) == 5.0
    assert math.isinf(graph.value((two / 0.0).ref))
    assert graph.value(abs(-two).ref) == 2.0
    assert graph.value(trace.fma(two, two, 1.0).ref) == 5.0


def test_neutral_operands_vanish(graph):
    x = graph.input("x")
    assert all(same(x, y) for y in (x + 0.0, 0.0 + x, x - 0.0, x * 1.0, 1.0 * x, x / 1.0, +x))
    turned = -x
    assert same(-turned, x)
    assert same(x * -1.0, -x)
    assert graph.value((x * 0.0).ref) == 0.0


def test_a_difference_with_itself_stays_since_infinity_minus_infinity_is_no_number(graph):
    x = graph.input("x")
    assert graph.value((x - x).ref) is None
    assert math.isnan(Formulas.of(graph, [x - x]).replay({"x": math.inf})[0])


def test_signs_are_pulled_out_and_shared(graph):
    x, y = graph.input("x"), graph.input("y")
    assert same(x + -y, x - y)
    assert same(y - x, -(x - y))
    assert same(-x - y, -(x + y))
    assert same((-x) * y, -(x * y))
    assert same((-x) / (-y), x / y)
    assert same(abs(-x), abs(x))
    assert same(where(x > 0.0, -x, -y), -where(x > 0.0, x, y))
    assert same(trace.fma(-x, y, -1.0), -trace.fma(x, y, 1.0))


def test_equal_computations_are_one(graph):
    x, y = graph.input("x"), graph.input("y")
    before = len(graph.nodes)
    assert same(x * y + 1.0, 1.0 + y * x)
    assert len(graph.nodes) == before + 2
    assert same(x + x, x * 2.0)
    assert same(x / 4.0, x * 0.25)
    assert not same(x / 3.0, x * (1.0 / 3.0))


def test_sine_and_cosine_of_one_angle_share_all_but_the_choice(graph):
    x = graph.input("x")
    sin(x)
    alone = len(graph.nodes)
    cos(x)
    assert len(graph.nodes) - alone <= 4


def test_known_conditions_choose(graph):
    x, y = graph.input("x"), graph.input("y")
    assert same(where(True, x, y), x)
    assert same(where(x * 0.0 > 1.0, x, y), y)
    assert same(where(x > y, x, x), x)
    m = x > 0.0
    assert same(where(m, where(m, x, y), 1.0), where(m, x, 1.0))
    assert same(where(~m, x, y), where(m, y, x))
    assert (m & ~m).ref == (x < x).ref == TRUE ^ 1
    assert (m | True).ref == TRUE and (m & True).ref == m.ref
    assert (where(m, 1.0, 0.0) != 0.0).ref == m.ref
    assert (where(m, 1.0, 0.0) < 0.5).ref == (~m).ref


def test_comparisons_with_not_a_number_are_those_of_ieee(graph):
    x, y = graph.input("x"), graph.input("y")
    masks = [x < y, x <= y, x > y, x >= y, x == y, x != y, ~(x < y)]
    formulas = Formulas.of(graph, masks)
    for a, b in ((1.0, 2.0), (2.0, 2.0), (math.nan, 1.0), (1.0, math.nan)):
        assert formulas.replay({"x": a, "y": b}) == [a < b, a <= b, a > b, a >= b, a == b, a != b, not a < b]


def test_powers_are_products(graph):
    x = graph.input("x")
    assert same(x**2, x * x)
    assert same(x**3, x * (x * x))
    assert graph.value((x**0).ref) == 1.0
    assert same(x**-2, 1.0 / (x * x))


def test_numpy_numbers_stand_on_either_side(graph):
    x = graph.input("x")
    two = np.float64(2.0)
    assert same(two * x, x * 2.0) and same(two - x, 2.0 - x) and same(two / x, 2.0 / x)
    assert (two > x).ref == (x < 2.0).ref and (np.bool_(True) & (x > 0.0)).ref == (x > 0.0).ref


# Formulas


def some_formulas():
    graph = Graph()
    x, y = graph.input("x"), graph.input("y")
    sin(x + 3.0)  # dead
    outputs = [
        sin(x) * y,
        where(x < y, math.inf, -x),
        trace.gather((1.0, math.nan, 0.1), y),
        0.1 + 0.2,
        x,
        where(x > 0.0, math.nan, 1e-310),
    ]
    return Formulas.of(graph, outputs)


def test_formulas_survive_json_to_the_last_bit():
    formulas = some_formulas()
    text = json.dumps(vars(formulas), allow_nan=False)
    again = Formulas(**json.loads(text))
    assert again == formulas
    assert json.dumps(vars(some_formulas()), allow_nan=False) == text


def test_formulas_name_only_what_they_need():
    formulas = some_formulas()
    assert formulas.inputs == ("x", "y")
    assert Formulas().replay({}) == []
    dead = Graph()
    dead.input("unused")
    assert Formulas.of(dead, [dead.input("b") + 1.0]).inputs == ("b",)


def test_formulas_replay_alike_over_numbers_arrays_and_scalars():
    formulas = some_formulas()
    x, y = np.random.default_rng(7).normal(size=(2, 40)) * 3.0
    at_once = formulas.replay({"x": x, "y": y})
    graph = Graph()
    spliced = Formulas.of(graph, formulas.replay({"x": graph.input("a"), "y": graph.input("b")}))
    for i in range(40):
        one = formulas.replay({"x": float(x[i]), "y": float(y[i])})
        two = spliced.replay({"a": float(x[i]), "b": float(y[i])})
        expected = [np.broadcast_to(column, 40)[i] for column in at_once]
        assert np.array_equal(one, expected, equal_nan=True)
        assert np.array_equal(two, expected, equal_nan=True)


def test_replay_folds_where_an_input_is_known():
    graph = Graph()
    formulas = Formulas.of(graph, [graph.input("x") * graph.input("m")])
    again = Graph()
    (product,) = formulas.replay({"x": again.input("x"), "m": 0.0})
    assert again.value(product.ref) == 0.0


# Refusals


def refused(graph, text, **names):
    """The diagnostic that a line of a model gets, with where it points."""
    line = "ask = " + text
    source = f"def model(x, y):\n    a = 1.0\n    {line}\n    return a\n"
    space = {"math": math, "np": np, "trace": trace, **names}
    exec(compile(source, "/models/wrong.py", "exec"), space)
    with pytest.raises(Problem) as caught:
        space["model"](graph.input("x"), graph.input("y"))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "E200"
    assert (diagnostic.at.place.file, diagnostic.at.place.line) == ("/models/wrong.py", 3)
    return diagnostic


@pytest.mark.parametrize(
    "text",
    [
        "1.0 if x > 0.0 else 2.0",
        "x > 0.0 and y > 0.0",
        "not x > 0.0",
        "bool(x)",
        "float(x)",
        "int(x)",
        "[1, 2][x]",
        "range(x)",
        "math.sin(x)",
        "np.sin(x)",
        "round(x)",
        "min(x, y)",
        "x ** 0.5",
        "2.0 ** x",
        "x % 2.0",
        "(x > 0.0) * y",
        "list(x)",
        "0.0 < x < 1.0",
        "trace.where(x, 1.0, 2.0)",
        "math.floor(x)",
        "complex(x)",
    ],
)
def test_what_only_a_run_knows_is_refused_at_the_models_line(graph, text):
    assert refused(graph, text).help


def test_a_refusal_points_at_the_piece_of_the_line_and_names_the_remedy(tmp_path, graph):
    path = tmp_path / "servo.py"
    path.write_text(
        "import math\nfrom met.trace import Real\n\n\ndef torque(w: Real) -> Real:\n"
        "    if w > 0.0:\n        return 1.0\n    return 2.0 * math.tanh(w)\n"
    )
    space: dict = {}
    exec(compile(path.read_text(), str(path), "exec"), space)
    with pytest.raises(Problem) as caught:
        space["torque"](graph.input("w"))
    (diagnostic,) = caught.value.diagnostics
    place = diagnostic.at.place
    assert (place.file, place.line, place.column, place.length) == (str(path), 6, 8, 7)
    assert diagnostic.message == "a model asks for the truth of a recorded condition, for `if`, which only a run knows"
    assert diagnostic.help == ("where(condition, a, b) computes both and keeps one",)


def test_a_foreign_function_is_named_with_ours(tmp_path, graph):
    path = tmp_path / "servo.py"
    path.write_text("import math\n\n\ndef torque(w):\n    return 2.0 * math.tanh(w)\n")
    space: dict = {}
    exec(compile(path.read_text(), str(path), "exec"), space)
    with pytest.raises(Problem) as caught:
        space["torque"](graph.input("w"))
    (diagnostic,) = caught.value.diagnostics
    assert (diagnostic.at.place.line, diagnostic.at.place.column, diagnostic.at.place.length) == (5, 18, 12)
    assert "math.tanh(w)" in diagnostic.message
    assert diagnostic.help == ("use met.trace.tanh",)


@pytest.mark.parametrize("text", ["math.hypot(x, 1.0)", "float(x)", "s(x)"])
def test_a_function_that_has_no_counterpart_is_told_of_those_that_there_are(graph, text):
    from met.trace.refusal import RECORDS

    assert refused(graph, text, s=math.sin).help == (RECORDS,)


def test_two_graphs_do_not_meet(graph):
    with pytest.raises(ValueError, match="two graphs"):
        graph.input("x") + Graph().input("x")
