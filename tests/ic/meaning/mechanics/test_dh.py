"""Denavit-Hartenberg numbers of joints: frames against products of matrices, motion against Pinocchio, messages."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from ic.meaning.mechanics.dh import CONVENTIONS, JointFrame
from met import run as engine
from met.dynamics.kinematics import link_motions
from met.dynamics.spatial import rotation_rpy
from met.plan import Experiment
from met.program.system import System
from met.trace import Formulas, Graph
from tests.ic.small_decks import check, experiment, messages
from tests.oracles import denavit_hartenberg as dh
from tests.oracles.package import Package

pin = Package("pinocchio")


SEED = 1955
RUN = """
default run fall {
    arm = arm_of_tables;  environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { dynamics = 1 kHz; }  duration = 1 ms;  record = [qdd];
}
"""


def joint(name: str, kind: str, parent: str, child: str, convention: str, row: dh.Row) -> str:
    a, alpha, d, theta = row
    numbers = f"a = {a!r} m, alpha = {alpha!r} rad, d = {d!r} m, theta = {theta!r} rad"
    kind = {"R": "revolute", "P": "prismatic", "F": "fixed"}[kind]
    return f"joint {name} {kind} {{ parent = {parent}; child = {child}; dh = {convention}({numbers}); }}\n"


def arm(convention: str, rows: Sequence[dh.Row], kinds: str, bodies: Sequence[dh.Body] = ()) -> str:
    """A deck's arm of links l0, l1, ... and joints j0, j1, ..."""
    text = ""
    for i, (row, kind) in enumerate(zip(rows, kinds, strict=True)):
        mass, com, moments = bodies[i] if bodies else (1.0, (0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
        text += joint(f"j{i}", kind, f"l{i - 1}" if i else "base", f"l{i}", convention, row)
        text += f"link l{i} {{ mass = {mass} kg; com = {list(com)} m; inertia = {list(moments)} kg*m^2; }}\n"
    return f"arm arm_of_tables {{\n{text}}}\n"


def frames(made: Experiment, q: Sequence[float]) -> dict[str, np.ndarray]:
    """4x4 of every link's frame in the world, by the tree that the engine moves."""
    tree = System(made).tree(lambda _: 0.0)
    found = {}
    for name, motion in link_motions(tree, tuple(q), (0.0,) * len(q)).items():
        found[name] = np.eye(4)
        found[name][:3, :3], found[name][:3, 3] = np.array(motion.pose.R, float), np.array(motion.pose.p, float)
    return found


def at(frame: JointFrame, kind: str, q: float) -> np.ndarray:
    """Equation (1) of docs/physics.md in numpy: the link's frame in the parent's."""
    K = np.cross(np.eye(3), np.array(frame.axis, float))  # K v = axis x v
    turn = np.eye(3) + np.sin(q) * K + (1.0 - np.cos(q)) * K @ K if kind == "R" else np.eye(3)
    pivot = np.array(frame.pivot, float) if kind == "R" else np.zeros(3)
    slide = q * np.array(frame.axis, float) if kind == "P" else np.zeros(3)
    R = np.array(rotation_rpy(*frame.rpy), float)
    made = np.eye(4)
    made[:3, :3] = R @ turn
    made[:3, 3] = np.array(frame.at, float) + R @ (pivot - turn @ pivot + slide)
    return made


RIGHT = (0.0, np.pi / 2, -np.pi / 2, np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["R", "P"])
@pytest.mark.parametrize("convention", list(CONVENTIONS))
def test_a_joints_frame_moves_as_the_product_of_its_row(convention: str, kind: str) -> None:
    rng = np.random.default_rng(SEED)
    rows = [tuple(rng.uniform(-3.0, 3.0, 4)) for _ in range(200)]
    rows += [(0.3, alpha, 0.2, theta) for alpha in RIGHT for theta in RIGHT]
    rows += [(0.3, alpha + 1e-9, 0.2, theta - 1e-9) for alpha in RIGHT for theta in RIGHT]  # where yaw is hardly any
    for row in rows:
        for q in (0.0, 0.7):
            found = at(CONVENTIONS[convention](*row), kind, q)
            # some ten roundings of numbers up to 3 m
            np.testing.assert_allclose(
                found, dh.link(convention, dh.moved(row, kind, q)), atol=1e-14, err_msg=f"{row}, {SEED=}"
            )


@pytest.mark.parametrize("convention", list(CONVENTIONS))
def test_recorded_numbers_give_the_frame_that_plain_ones_give(convention: str) -> None:
    rng = np.random.default_rng(SEED)
    rows = np.concatenate([rng.uniform(-3.0, 3.0, (100, 4)), [[0.1, x, 0.2, y] for x in RIGHT for y in RIGHT]])
    graph = Graph()
    names = ("a", "alpha", "d", "theta")
    frame = CONVENTIONS[convention](*(graph.input(name) for name in names))
    made = Formulas.of(graph, [x for part in (frame.at, frame.rpy, frame.axis, frame.pivot) for x in part])
    columns = made.replay(dict(zip(names, rows.T, strict=True)))
    for k, row in enumerate(rows):
        numbers = iter(float(np.broadcast_to(column, len(rows))[k]) for column in columns)
        lane = JointFrame(*(tuple(next(numbers) for _ in range(3)) for _ in range(4)))
        # not number by number: where the frame's x is vertical, roll and yaw are any with one sum
        np.testing.assert_allclose(at(lane, "R", 0.4), dh.link(convention, dh.moved(tuple(row), "R", 0.4)), atol=1e-14)


TABLES = [
    pytest.param("classic", dh.PUMA_CLASSIC, "RRRRRR", id="Puma 560, classic"),
    pytest.param("craig", dh.shifted(dh.PUMA_CLASSIC), "RRRRRRF", id="Puma 560, the same in Craig's form"),
    pytest.param("craig", dh.PUMA_OF_CRAIGS_BOOK, "RRRRRR", id="Puma 560 of Craig's book"),
    pytest.param("classic", dh.STANFORD, dh.STANFORD_KINDS, id="Stanford arm, classic"),
    pytest.param("craig", dh.shifted(dh.STANFORD), dh.STANFORD_KINDS + "F", id="Stanford arm in Craig's form"),
]


@pytest.mark.slow
@pytest.mark.parametrize(("convention", "rows", "kinds"), TABLES)
def test_every_link_is_where_the_product_of_the_published_rows_has_it(
    tmp_path: Path, convention: str, rows: tuple[dh.Row, ...], kinds: str
) -> None:
    made = experiment(tmp_path, arm(convention, rows, kinds), RUN)
    rng = np.random.default_rng(SEED)
    for _ in range(20):
        q = rng.uniform(-3.0, 3.0, len(kinds.replace("F", "")))
        all_q = [*q, *[0.0] * kinds.count("F")]
        wanted = dh.poses(convention, rows, kinds.replace("F", "R"), all_q)
        for name, pose in frames(made, q).items():
            # tens of roundings of lengths of metres
            np.testing.assert_allclose(pose, wanted[int(name[1:])], atol=1e-13, err_msg=f"{name}, {SEED=}")


@pytest.mark.slow
@pytest.mark.parametrize(("rows", "kinds"), [(dh.PUMA_CLASSIC, "RRRRRR"), (dh.STANFORD, dh.STANFORD_KINDS)])
def test_both_conventions_end_at_one_point(tmp_path: Path, rows: tuple[dh.Row, ...], kinds: str) -> None:
    classic = experiment(tmp_path, arm("classic", rows, kinds), RUN)
    craig = experiment(tmp_path, arm("craig", dh.shifted(rows), kinds + "F"), RUN)
    for q in np.random.default_rng(SEED).uniform(-3.0, 3.0, (20, 6)):
        np.testing.assert_allclose(frames(craig, q)["l6"], frames(classic, q)["l5"], atol=1e-13)  # as above


def bodies(count: int) -> tuple[dh.Body, ...]:
    rng = np.random.default_rng(SEED + 1)
    return tuple(
        (
            float(rng.uniform(0.5, 9.0)),
            tuple(rng.uniform(-0.3, 0.3, 3).tolist()),
            tuple(rng.uniform(0.3, 0.5, 3).tolist()),
        )
        for _ in range(count)
    )


@pytest.mark.oracle
@pytest.mark.parametrize(("convention", "rows", "kinds"), [table for table in TABLES if "F" not in table.values[2]])
def test_accelerations_are_those_of_pinocchio_by_the_same_table(
    tmp_path: Path, convention: str, rows: tuple[dh.Row, ...], kinds: str
) -> None:
    """A link's inertia stands in its Denavit-Hartenberg frame. 5 states, and in each another length of a row."""
    rng = np.random.default_rng(SEED)
    given = bodies(len(rows))
    q, qd = rng.uniform(-2.5, 2.5, (5, 6)), rng.uniform(-1.0, 1.0, (5, 6))
    a, alpha = rng.uniform(0.1, 0.5, 5), rng.uniform(-1.0, 1.0, 5)
    columns = "".join(
        f"initial.j{i}.{what} = {values[:, i].tolist()} {'m' if kind == 'P' else 'rad'}{rate};"
        for i, kind in enumerate(kinds)
        for what, values, rate in (("q", q, ""), ("qd", qd, "/s"))
    )
    columns += f"j1.dh.a = {a.tolist()} m; j2.dh.alpha = {alpha.tolist()} rad;"
    made = experiment(
        tmp_path,
        arm(convention, rows, kinds, given),
        RUN,
        f"sweep states of fall {{ zip {{ {columns} }} }}",
        select=["states"],
    )
    found = engine.run(made).signals["qdd"][:, 0]
    for case in range(5):
        own = list(rows)
        own[1] = (float(a[case]), *rows[1][1:])
        own[2] = (rows[2][0], float(alpha[case]), *rows[2][2:])
        model = dh.model(convention, own, kinds, given)
        wanted = pin.aba(model, model.createData(), q[case], qd[case], np.zeros(6))
        # rounding, times the condition number of the mass matrix (up to some 1e3)
        np.testing.assert_allclose(
            found[case], wanted, rtol=1e-11, atol=1e-11 * np.abs(wanted).max(), err_msg=f"{SEED=}"
        )


def test_a_plan_has_the_frame_and_the_rows_numbers_are_explained_and_varied(tmp_path: Path) -> None:
    made = experiment(tmp_path, arm("classic", dh.PUMA_CLASSIC, "RRRRRR"), RUN)
    for path, value in {"j1.at.x": 0.4318, "j1.pivot.x": -0.4318, "j2.at.z": 0.15005, "j2.axis.y": -1.0}.items():
        assert made.parameters[path].value == value
        assert made.parameters[path].origin.note == "Denavit-Hartenberg, classic"
    assert "j3.pivot.x" not in made.parameters  # a = 0: the axis passes the link's frame
    assert not any(path.endswith((".a", ".alpha", ".d", ".theta")) for path in made.parameters)


def test_a_definition_that_is_like_another_changes_one_number_of_the_row(tmp_path: Path) -> None:
    longer = "arm longer like arm_of_tables { j1 { dh { a = 1 m; } } }\nrun other like fall { arm = longer; }\n"
    made = experiment(tmp_path, arm("craig", dh.PUMA_OF_CRAIGS_BOOK, "RRRRRR"), RUN, longer, select=["other"])
    assert made.parameters["j1.at.x"].value == 1.0
    assert made.parameters["j2.at.x"].value == 0.4318


# messages


ONE = """\
arm arm_of_tables {
    link l0 { mass = 1 kg; shape = sphere(radius = 1 cm); }
    joint j0 revolute { parent = base; child = l0; XXX }
}
"""
SWEEP = "sweep many of fall { vary j0.at.x = [1, 2] m; }\n"


@pytest.mark.parametrize(("written", "message"), [
    ("dh = modified(a = 1 m);", """\
error[D180]: no Denavit-Hartenberg convention `modified`
 --> deck.ic:3:57
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = modified(a = 1 m); }
  |                                                         ^^^^^^^^^^^^^^^^^
  = help: write `craig`
  = help: write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`
"""),
    ("dh = clasic(a = 1 m);", """\
error[D180]: no Denavit-Hartenberg convention `clasic`
 --> deck.ic:3:57
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = clasic(a = 1 m); }
  |                                                         ^^^^^^^^^^^^^^^
  = help: did you mean `classic`?
  = help: write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`
"""),
    ("dh = [1, 2, 3, 4] m;", """\
error[D180]: the name of a convention is needed here
 --> deck.ic:3:57
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = [1, 2, 3, 4] m; }
  |                                                         ^^^^^^^^^^^^^^
  = help: write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`
"""),
    ("axis = z; dh = classic(a = 1 m);", """\
error[D181]: joint `j0` has both `dh` and `axis`
 --> deck.ic:3:52
  |
3 |     joint j0 revolute { parent = base; child = l0; axis = z; dh = classic(a = 1 m); }
  |                                                    ^^^^
 ::: deck.ic:3:62  the Denavit-Hartenberg numbers
  = help: `dh` says all of the joint's frame: leave `axis` out (`remove axis;` where a base has it)
"""),
    ("dh = classic(r = 1 m);", """\
error[D141]: the dh of joint `j0` has no `r`
 --> deck.ic:3:65
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = classic(r = 1 m); }
  |                                                                 ^
  = help: it has: a, alpha, d, theta
"""),
    ("dh = classic(a = 1 rad);", """\
error[D061]: `a` of the dh of joint `j0` is in m, and this is in rad
 --> deck.ic:3:69
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = classic(a = 1 rad); }
  |                                                                     ^^^^^
  = help: write it in m, km, cm, mm, um, inch or ft
"""),
    ("dh = classic(1 m, 2 rad, 0 m, 0 rad);", """\
error[D180]: `classic` takes its numbers by name
 --> deck.ic:3:65
  |
3 |     joint j0 revolute { parent = base; child = l0; dh = classic(1 m, 2 rad, 0 m, 0 rad); }
  |                                                                 ^^^
  = help: write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`
"""),
    ("dh { a = 1 m; }", """\
error[D180]: the name of a convention is needed here
 --> deck.ic:3:52
  |
3 |     joint j0 revolute { parent = base; child = l0; dh { a = 1 m; } }
  |                                                    ^^
  = help: write `dh = classic(a = ..., alpha = ..., d = ..., theta = ...)`, or `craig(...)`
"""),
])  # fmt: skip
def test_a_mistake_in_a_row_is_told(tmp_path: Path, written: str, message: str) -> None:
    said = messages(check(tmp_path, ONE.replace("XXX", written), RUN)).rpartition("\n\n")[0] + "\n"
    assert said == message


def test_what_follows_from_a_row_cannot_vary_by_itself(tmp_path: Path) -> None:
    said = messages(check(tmp_path, ONE.replace("XXX", "dh = craig(a = 1 m);"), RUN, SWEEP, select=["many"]))
    assert (
        said.rpartition("\n\n")[0] + "\n"
        == """\
error[D122]: `j0.at.x` cannot vary
  --> deck.ic:10:27
   |
10 | sweep many of fall { vary j0.at.x = [1, 2] m; }
   |                           ^^^^^^^
   = help: it follows from `j0.dh`; vary one of: `j0.dh.a`, `j0.dh.alpha`, `j0.dh.d`, `j0.dh.theta`
"""
    )
