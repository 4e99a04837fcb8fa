"""Arms: inertia of shapes, frames, and what can be no arm."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from met.plan import Experiment
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

MOMENTS = ("xx", "yy", "zz", "xy", "xz", "yz")


def with_link(folder: Path, link: str) -> Experiment:
    return experiment(folder, changed(ARM, ("mass = 2 kg; shape = rod(length = 1 m, along = x);", link)), SERVO, RUN)


def numbers(run: Experiment, path: str, names: tuple[str, ...]) -> list[float]:
    values = [run.parameters[f"{path}.{name}"].value for name in names]
    return [float(value) for value in values if isinstance(value, float)]


def sampled(points: np.ndarray, mass: float) -> list[float]:
    """Inertia of equal masses at the points about their centre, xx yy zz xy xz yz (products as -sum m x y)."""
    x, y, z = (points - points.mean(axis=0)).T
    each = mass / len(points)
    return [
        each * float(np.sum(moment)) for moment in (y * y + z * z, x * x + z * z, x * x + y * y, -x * y, -x * z, -y * z)
    ]


@pytest.mark.parametrize(
    ("shape", "size", "com"),
    [
        ("box(size = [0.4, 0.2, 0.1] m)", (0.4, 0.2, 0.1), (0.2, 0.0, 0.0)),
        ("box(size = [0.4, 0.2, 0.1] m, along = z)", (0.4, 0.2, 0.1), (0.0, 0.0, 0.05)),
        ("rod(length = 0.4 m, along = y)", (0.0, 0.4, 0.0), (0.0, 0.2, 0.0)),
    ],
)
def test_a_shape_has_the_inertia_of_many_points_in_it(
    tmp_path: Path, shape: str, size: tuple[float, ...], com: tuple[float, ...]
) -> None:
    run = with_link(tmp_path, f"mass = 3 kg; shape = {shape};")
    n = 200
    ticks = (np.arange(n) + 0.5) / n - 0.5
    found = numbers(run, "links.bar.inertia", MOMENTS)
    # along each axis the midpoints' mean square is (1 - 1/n^2)/12 of the length's square
    squares = [side * side * float(np.mean(ticks * ticks)) for side in size]
    expected = [3.0 * (sum(squares) - own) for own in squares]
    assert found[:3] == pytest.approx(expected, rel=2.0 / n**2, abs=1e-15)
    assert found[3:] == [0.0, 0.0, 0.0]
    assert numbers(run, "links.bar.com", ("x", "y", "z")) == pytest.approx(com, rel=1e-15)


@pytest.mark.parametrize(
    ("shape", "in_shape", "com"),
    [
        ("sphere(radius = 0.1 m)", lambda x, y, z: x * x + y * y + z * z <= 0.01, (0.0, 0.0, 0.0)),
        ("cylinder(radius = 0.1 m, length = 0.2 m, along = z)", lambda x, y, z: x * x + y * y <= 0.01, (0.0, 0.0, 0.1)),
        ("cylinder(radius = 0.1 m, length = 0.2 m, along = x)", lambda x, y, z: y * y + z * z <= 0.01, (0.1, 0.0, 0.0)),
    ],
)
def test_a_round_shape_has_the_inertia_of_many_points_in_it(
    tmp_path: Path, shape: str, in_shape: object, com: tuple[float, ...]
) -> None:
    run = with_link(tmp_path, f"mass = 3 kg; shape = {shape};")
    ticks = (np.arange(80) + 0.5) / 400 - 0.1  # midpoints of 80 cells from -0.1 to 0.1
    cube = np.stack(np.meshgrid(ticks, ticks, ticks), axis=-1).reshape(-1, 3)
    points = cube[in_shape(*cube.T)]  # type: ignore[operator]
    # the round boundary is cut by cells of 1/40 of the radius, which errs by less than 1 %
    found = numbers(run, "links.bar.inertia", MOMENTS)
    assert found == pytest.approx(sampled(points, 3.0), rel=0.01, abs=1e-12)
    assert numbers(run, "links.bar.com", ("x", "y", "z")) == pytest.approx(com, rel=1e-15)


def test_written_numbers_win_over_the_shapes(tmp_path: Path) -> None:
    run = with_link(
        tmp_path, "mass = 1 kg; com = [1, 2, 3] m; inertia = [2, 3, 4] kg*m^2; shape = rod(length = 1 m, along = x);"
    )
    assert numbers(run, "links.bar.com", ("x", "y", "z")) == [1.0, 2.0, 3.0]
    assert numbers(run, "links.bar.inertia", MOMENTS) == [2.0, 3.0, 4.0, 0.0, 0.0, 0.0]
    assert run.structure.links[0].shape == ("rod", (("length", 1.0), ("along", 0.0)))


def test_six_numbers_are_moments_then_products(tmp_path: Path) -> None:
    run = with_link(tmp_path, "mass = 1 kg; inertia = [2, 3, 4, 0.1, 0.2, 0.3] kg*m^2;")
    assert numbers(run, "links.bar.inertia", MOMENTS) == [2.0, 3.0, 4.0, 0.1, 0.2, 0.3]


@pytest.mark.parametrize(
    ("axis", "unit"),
    [
        ("x", (1.0, 0.0, 0.0)),
        ("-z", (0.0, 0.0, -1.0)),
        ("[0, 3, 4]", (0.0, 0.6, 0.8)),
    ],
)
def test_an_axis_is_a_unit_vector(tmp_path: Path, axis: str, unit: tuple[float, ...]) -> None:
    run = experiment(tmp_path, changed(ARM, ("axis = z", f"axis = {axis}")), SERVO, RUN)
    assert numbers(run, "hinge.axis", ("x", "y", "z")) == pytest.approx(unit, rel=1e-15)


def test_angles_of_a_frame_are_radians_in_the_plan(tmp_path: Path) -> None:
    run = experiment(tmp_path, changed(ARM, ("axis = z;", "axis = z; rpy = [90, 0, -180] deg;")), SERVO, RUN)
    assert numbers(run, "hinge.rpy", ("x", "y", "z")) == pytest.approx((math.pi / 2, 0.0, -math.pi), rel=1e-15)


def test_a_thin_rod_may_be_written_as_its_inertia_too(tmp_path: Path) -> None:
    """Its moment about its own length is zero: in any axes, and in any order."""
    rod, rest = "shape = rod(length = 1 m, along = x);", "com = [0.5, 0, 0] m; inertia = [0, 2/12, 2/12] kg*m^2;"
    shaped, written = (experiment(tmp_path, changed(ARM, (rod, text)), SERVO, RUN) for text in (rod, rest))
    parts = ("mass", "com.x", "inertia.xx", "inertia.yy", "inertia.zz", "inertia.xy")
    for part in parts:
        assert written.parameters[f"links.bar.{part}"].value == pytest.approx(
            shaped.parameters[f"links.bar.{part}"].value, rel=1e-15, abs=0.0
        )
    aslant = "[1.333333333, 1.333333333, 1.333333333, -0.6666666667, -0.6666666667, -0.6666666667]"
    for six in ("[2, 0, 2]", "[2, 2, 0]", "[1, 1, 2, -1, 0, 0]", aslant):
        assert codes(tmp_path, changed(ARM, (rod, f"inertia = {six} kg*m^2;")), SERVO, RUN) == [], six


@pytest.mark.slow
@pytest.mark.parametrize(
    ("link", "code"),
    [
        ("shape = rod(length = 1 m, along = x);", "D075"),  # no mass
        ("mass = 0 kg; shape = rod(length = 1 m, along = x);", "D217"),  # and its joint moves nothing else
        ("mass = 0 kg; inertia = [1, 1, 1] kg*m^2;", "D087"),
        ("mass = -1 kg; shape = rod(length = 1 m, along = x);", "D077"),
        ("mass = 1 kg; shape = rod(length = 0 m, along = x);", "D077"),
        ("mass = 1 kg;", "D089"),
        ("mass = 1 kg; inertia = [1, 1, 3] kg*m^2;", "D087"),  # 1 + 1 < 3
        ("mass = 1 kg; inertia = [1, 1.1, 0] kg*m^2;", "D087"),  # two alike would be a thin rod's
        ("mass = 1 kg; inertia = [0, 0, 1] kg*m^2;", "D087"),
        ("mass = 1 kg; inertia = [-1e-3, 1, 1] kg*m^2;", "D087"),
        ("mass = 1 kg; inertia = [1, 1, 1, 2, 0, 0] kg*m^2;", "D087"),  # a negative principal moment
        ("mass = 1 kg; inertia = [1, 1] kg*m^2;", "D071"),
        ("mass = 1 kg; inertia = [1, 1, 1];", "D060"),
        ("mass = 1 kg; shape = rod(length = 1 m, along = w);", "D076"),
        ("mass = 1 kg; shape = rod(length = 1 m);", "D075"),
        ("mass = 1 kg; shape = cone(length = 1 m);", "D088"),
        ("mass = 1 kg; shape = sphere(radius = 1 m, size = 2 m);", "D141"),
        ("mass = 1 kg; shape = sphere(radius = 1 m); colour = 3;", "D141"),
    ],
)
def test_a_link_that_can_be_no_body_is_told_once(tmp_path: Path, link: str, code: str) -> None:
    arm = changed(ARM, ("mass = 2 kg; shape = rod(length = 1 m, along = x);", link))
    assert codes(tmp_path, arm, SERVO, RUN) == [code]


@pytest.mark.parametrize(
    ("joint", "code"),
    [
        ("joint hinge turning { parent = base; child = bar; axis = z; }", "D090"),
        ("joint hinge { parent = base; child = bar; axis = z; }", "D090"),
        ("joint hinge revolute { child = bar; axis = z; }", "D092"),
        ("joint hinge revolute { parent = base; axis = z; }", "D092"),
        ("joint hinge revolute { parent = bse; child = bar; axis = z; }", "D094"),
        ("joint hinge revolute { parent = bar; child = base; axis = z; }", "D093"),
        ("joint hinge revolute { parent = base; child = bar; }", "D096"),
        ("joint hinge revolute { parent = base; child = bar; axis = [0, 0, 0]; }", "D097"),
        ("joint hinge revolute { parent = base; child = bar; axis = [0, 0, 1] m; }", "D061"),
        ("joint hinge fixed { parent = base; child = bar; axis = z; }", "D095"),
        ("joint hinge revolute { parent = base; child = bar; axis = z; at = 1 m; }", "D071"),
    ],
)
def test_a_joint_that_can_be_none_is_told(tmp_path: Path, joint: str, code: str) -> None:
    arm = changed(ARM, ("joint hinge revolute { parent = base; child = bar; axis = z; }", joint))
    assert code in codes(
        tmp_path, arm, "run still { arm = swing; rates { dynamics = 1 kHz; } duration = 1 s; record = []; }"
    )


LINKS = "".join(f"link {name} {{ mass = 1 kg; shape = sphere(radius = 1 cm); }}\n" for name in "abcd")


def tree(*joints: str) -> tuple[str, str]:
    lines = []
    for n, (parent, child) in enumerate(joint.split() for joint in joints):
        lines.append(f"joint j{n} revolute {{ parent = {parent}; child = {child}; axis = z; }}\n")
    return (
        f"arm tangle {{ {LINKS}{''.join(lines)} }}\n",
        "run still { arm = tangle; rates { dynamics = 1 kHz; } duration = 1 s; record = []; }",
    )


def test_joints_and_links_stand_in_any_order(tmp_path: Path) -> None:
    run = experiment(tmp_path, *tree("c d", "base a", "b c", "a b"))
    assert [joint.child for joint in run.structure.joints] == ["d", "a", "c", "b"]


def test_a_branch_is_a_tree(tmp_path: Path) -> None:
    assert codes(tmp_path, *tree("base a", "a b", "a c", "base d")) == []


def test_a_link_without_a_joint_hangs_in_the_air(tmp_path: Path) -> None:
    assert codes(tmp_path, *tree("base a", "a b", "b c")) == ["D099"]


def test_a_link_with_two_parents_is_told_with_both(tmp_path: Path) -> None:
    assert codes(tmp_path, *tree("base a", "a b", "a c", "b d", "c d")) == ["D098"]


def test_a_loop_is_told_with_the_way_round(tmp_path: Path) -> None:
    compiled = check(tmp_path, *tree("base a", "d b", "b c", "c d"))
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D086"
    assert "b -> c -> d -> b" in diagnostic.message


def test_what_hangs_on_a_loop_is_not_told_as_well(tmp_path: Path) -> None:
    assert codes(tmp_path, *tree("c a", "a b", "b a", "b d")) in (["D098", "D086"], ["D098", "D099"], ["D099", "D098"])


def test_an_arm_that_no_run_uses_is_checked_too(tmp_path: Path) -> None:
    other = changed(ARM, ("arm swing", "arm other"), ("2 kg", "-2 kg"))
    assert codes(tmp_path, ARM, other, SERVO, RUN) == ["D077"]


def test_several_mistakes_are_told_in_one_run(tmp_path: Path) -> None:
    arm = changed(ARM, ("2 kg", "-2 kg"), ("axis = z;", ""))
    compiled = check(tmp_path, arm, changed(SERVO, ("kp", "strength")), changed(RUN, ("[q]", "[qq]")))
    assert {diagnostic.code for diagnostic in compiled.diagnostics} == {"D077", "D141", "D096", "D075", "D125"}, (
        messages(compiled)
    )
