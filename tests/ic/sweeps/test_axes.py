"""Sweeps: order of cases, zips, exclusions, what a path reaches, and what cannot vary."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from met.plan import Experiment, Formula
from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, experiment, messages

TWO = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint wrist revolute { parent = bar; child = tip; axis = z; at = [1, 0, 0] m; }
}
servo other like drive { kp = 0.2 V*s/rad; }
"""
BOTH = changed(RUN, ("hinge = drive;", "hinge = drive; wrist = drive;"))


def swept(folder: Path, body: str, arm: str = ARM, run: str = RUN) -> Experiment:
    return experiment(folder, arm, SERVO, run, f"sweep it of hold {{ {body} }}\n", select=["it"])


def swept_codes(folder: Path, body: str, arm: str = ARM, run: str = RUN) -> list[str]:
    return codes(folder, arm, SERVO, run, f"sweep it of hold {{ {body} }}\n", select=["it"])


def rows(run: Experiment) -> list[tuple[float, ...]]:
    return list(zip(*(coordinate.values.tolist() for coordinate in run.cases.coordinates), strict=True))


def values(run: Experiment, path: str) -> np.ndarray:
    """A parameter over all cases."""
    value = run.parameters[path].value
    assert isinstance(value, Formula)
    inputs = {coordinate.path: coordinate.values for coordinate in run.cases.coordinates}
    return np.asarray(run.formulas.replay(inputs)[value.output])


def test_the_first_axis_is_the_outermost(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary drive.kp = [1, 2] V*s/rad; vary drive.ki = [3, 4, 5] V/rad;")
    assert rows(run) == [(1, 3), (1, 4), (1, 5), (2, 3), (2, 4), (2, 5)]


def test_a_zip_is_one_axis_where_it_is_written(tmp_path: Path) -> None:
    run = swept(
        tmp_path,
        "vary drive.kp = [1, 2] V*s/rad;"
        "zip { drive.ki = [3, 4] V/rad; links.bar.mass = [5, 6] kg; }"
        "vary drive.ratio = [7, 8];",
    )
    assert rows(run) == [
        (1, 3, 5, 7),
        (1, 3, 5, 8),
        (1, 4, 6, 7),
        (1, 4, 6, 8),
        (2, 3, 5, 7),
        (2, 3, 5, 8),
        (2, 4, 6, 7),
        (2, 4, 6, 8),
    ]


def test_coordinates_are_si_and_remember_the_decks_unit(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary links.bar.mass = [500, 1500] g;")
    (mass,) = run.cases.coordinates
    assert mass.values.tolist() == [0.5, 1.5]
    assert (mass.unit, mass.scale, mass.sets) == ("g", 1e-3, ("links.bar.mass",))


def test_exclude_drops_rows_and_keeps_the_order(tmp_path: Path) -> None:
    run = swept(
        tmp_path,
        "vary drive.kp = [1, 2] V*s/rad; vary links.bar.mass = [3, 4, 5] kg;"
        "exclude when drive.kp > 1.5 V*s/rad and not links.bar.mass < 3500 g or links.bar.mass == 5 kg;",
    )
    assert rows(run) == [(1, 3), (1, 4), (2, 3)]


def test_exclude_may_ask_for_any_parameter_of_the_run(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary links.bar.mass = [1, 2, 3] kg; exclude when links.bar.inertia.zz > 0.2 kg*m^2;")
    assert rows(run) == [(1,), (2,)]


def test_what_follows_from_a_coordinate_is_a_formula(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary links.bar.mass = [1, 2, 3] kg;")
    assert values(run, "links.bar.inertia.zz") == pytest.approx(np.array([1, 2, 3]) / 12.0, rel=1e-15)
    assert run.parameters["links.bar.com.x"].value == 0.5
    assert run.parameters["links.bar.mass"].origin.kind == "case"


def test_a_let_may_vary_and_everything_follows_it(tmp_path: Path) -> None:
    arm = "let reach = 1 m;\n" + changed(ARM, ("length = 1 m", "length = reach"))
    run = swept(tmp_path, "vary reach = [1, 2] m;", arm)
    assert values(run, "links.bar.com.x").tolist() == [0.5, 1.0]
    assert values(run, "links.bar.inertia.zz") == pytest.approx([2 / 12, 8 / 12], rel=1e-15)
    assert set(run.cases.coordinates[0].sets) == {"links.bar.com.x", "links.bar.inertia.yy", "links.bar.inertia.zz"}


def test_a_shapes_size_may_vary(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary links.bar.shape.length = [2, 4] m;")
    assert values(run, "links.bar.com.x").tolist() == [1.0, 2.0]
    assert run.structure.links[0].shape == ("rod", (("length", 2.0), ("along", 0.0)))  # drawn as in the first case


def test_a_derived_number_may_be_varied_itself(tmp_path: Path) -> None:
    solid = changed(ARM, ("rod(length = 1 m, along = x)", "cylinder(length = 1 m, radius = 0.1 m, along = x)"))
    run = swept(tmp_path, "vary links.bar.inertia.zz = [0.165, 0.17] kg*m^2;", solid)
    assert values(run, "links.bar.inertia.zz").tolist() == [0.165, 0.17]
    assert run.parameters["links.bar.inertia.yy"].value == pytest.approx(2.0 / 12.0 + 2.0 * 0.01 / 4.0)


def test_a_default_may_vary(tmp_path: Path) -> None:
    assert values(swept(tmp_path, "vary drive.f_c = [0, 0.1] N*m;"), "hinge.servo.f_c").tolist() == [0.0, 0.1]


def test_a_command_may_vary(tmp_path: Path) -> None:
    run = swept(tmp_path, "vary hinge.servo.command.value = [1, 2] rad/s; vary initial.hinge.q = [0, 90] deg;")
    assert values(run, "hinge.servo.command.value").tolist() == [1.0, 1.0, 2.0, 2.0]
    assert values(run, "initial.hinge.q")[1] == pytest.approx(np.pi / 2, rel=1e-15)


def test_a_definitions_path_reaches_all_uses_that_do_not_override_it(tmp_path: Path) -> None:
    run = changed(RUN, ("hinge = drive;", "hinge = drive; wrist = drive { kp = 9 V*s/rad; };"))
    found = swept(tmp_path, "vary drive.kp = [1, 2] V*s/rad; vary drive.ki = [1, 2] V/rad;", TWO, run)
    kp, ki = found.cases.coordinates
    assert kp.sets == ("hinge.servo.kp",)
    assert ki.sets == ("hinge.servo.ki", "wrist.servo.ki")


def test_a_base_definitions_path_reaches_those_like_it(tmp_path: Path) -> None:
    run = changed(RUN, ("hinge = drive;", "hinge = drive; wrist = other;"))
    found = swept(tmp_path, "vary drive.kp = [1, 2] V*s/rad; vary drive.ki = [1, 2] V/rad;", TWO, run)
    kp, ki = found.cases.coordinates
    assert kp.sets == ("hinge.servo.kp",)  # `other` writes its own
    assert ki.sets == ("hinge.servo.ki", "wrist.servo.ki")


def test_a_joints_path_reaches_that_joint_alone(tmp_path: Path) -> None:
    found = swept(tmp_path, "vary wrist.servo.kp = [1, 2] V*s/rad;", TWO, BOTH)
    assert found.parameters["hinge.servo.kp"].value == 0.1
    assert values(found, "wrist.servo.kp").tolist() == [1.0, 2.0]


def test_a_definition_and_one_of_its_joints_on_one_parameter_is_an_error(tmp_path: Path) -> None:
    body = "vary drive.kp = [1, 2] V*s/rad; vary wrist.servo.kp = [3, 4] V*s/rad;"
    compiled = check(tmp_path, TWO, SERVO, BOTH, f"sweep it of hold {{ {body} }}", select=["it"])
    (diagnostic,) = compiled.diagnostics
    assert (diagnostic.code, len(diagnostic.also)) == ("D123", 1)
    other = "vary drive.kp = [1, 2] V*s/rad; vary wrist.servo.ki = [3, 4] V/rad;"
    assert swept_codes(tmp_path, other, TWO, BOTH) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    ("body", "code"),
    [
        ("", "D126"),
        ("vary drive.kp = 1 V*s/rad;", "D126"),
        ("vary drive.kp = [] V*s/rad;", "D126"),
        ("vary drive.kp = [1, 2];", "D060"),
        ("vary drive.kp = [1, 2] V;", "D061"),
        ("vary drive.kp = [1 V*s/rad, 2 V];", "D063"),
        ("vary drive.kp = [1, 1] V*s/rad;", "D133"),
        ("vary drive.kp = [-1, 1] V*s/rad;", "D077"),
        ("vary drive.kq = [1, 2] V*s/rad;", "D128"),
        ("vary links.bar.mas = [1, 2] kg;", "D128"),
        ("vary links.bar.com = [1, 2] m;", "D122"),
        ("vary record = [1, 2];", "D122"),
        ("vary seed = [1, 2];", "D122"),
        ("vary hinge.servo.model = [1, 2];", "D143"),
        ("vary integrator = [1, 2];", "D143"),
        ("vary integrator = rk4;", "D126"),
        ("vary integrator = [rk4, rk4];", "D133"),
        ("vary integrator = [];", "D126"),
        ("zip { integrator = [rk4, midpoint]; drive.kp = [1] V*s/rad; }", "D135"),
        ("vary duration = 3 s;", "D126"),
        ("zip { drive.kp = [1, 2] V*s/rad; drive.ki = [1] V/rad; }", "D135"),
        ("zip { }", "D126"),
        ("vary drive.kp = [1, 2] V*s/rad; vary drive.kp = [1, 2] V*s/rad;", "D040"),
        ("vary drive.kp = (1 .. 2 by 0.3) V*s/rad;", "D220"),
        ("vary drive.kp = (1 .. 2) V*s/rad;", "D220"),
        ("vary drive.kp = (1 .. 2 by 0) V*s/rad;", "D072"),
        ("vary drive.kp = (1 .. 2 by -1) V*s/rad;", "D072"),
        ("vary drive.kp = (1 .. 2 by 1e-9) V*s/rad;", "D072"),
        ("vary drive.kp = 1 .. 2 V*s/rad by 1;", "D063"),
        ("repeat 1; vary drive.kp = [1, 2] V*s/rad;", "D113"),
        ("repeat 5; repeat 5;", "D040"),
        ("repeat = 5;", "D136"),
        ("repeat 5; vary drive.kp = [1, 2] V*s/rad;", "D230"),
        ("seeds = independent; vary drive.kp = [1, 2] V*s/rad;", "D230"),
        ("seeds = other; vary drive.kp = [1, 2] V*s/rad;", "D221"),
        ("sample { drive.kp = uniform(1, 2) V*s/rad; }", "D136"),
        ("sample many(3) { drive.kp = uniform(1, 2) V*s/rad; }", "D224"),
        ("sample lhs { drive.kp = uniform(1, 2) V*s/rad; }", "D136"),
        ("sample lhs(3);", "D224"),
        ("sample lhs(3, 4) { drive.kp = uniform(1, 2) V*s/rad; }", "D224"),
        ("sample lhs(3) { }", "D224"),
        ("sample lhs(3) { vary drive.kp = uniform(1, 2) V*s/rad; }", "D224"),
        ("sample lhs(3.5) { drive.kp = uniform(1, 2) V*s/rad; }", "D113"),
        ("sample lhs(3) { drive.kp = [1, 2] V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = gaussian(1, 2) V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = uniform(1) V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = uniform(2, 1) V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = normal(2, 0) V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = loguniform(-1, 1) V*s/rad; }", "D225"),
        ("sample lhs(3) { drive.kp = uniform(1, 2) V; }", "D061"),
        ("sample lhs(3) { drive.kp = uniform(1, 2); }", "D060"),
        ("sample lhs(3) { drive.kp = uniform(1 V*s/rad, 2 V); }", "D063"),
        ("sample lhs(3) { drive.kp = normal(0.1, 1) V*s/rad; }", "D077"),
        ("sample sobol(3) { drive.kp = uniform(1, 2) V*s/rad; }", "D228"),
        ('from "cases.csv";', "D190"),
        ("from cases;", "D222"),
        ("require settle < 1 s;", "D136"),
        ("vary links.bar.inertia.xx = [0.2, 0.3] kg*m^2;", "D137"),
        ("duration = 3 s; vary drive.kp = [1, 2] V*s/rad;", "D136"),
        ("vary drive.kp = linspace(1, 2, 10001) V*s/rad; vary drive.ki = linspace(1, 2, 10001) V/rad;", "D134"),
        ("vary drive.kp = [1, 2] V*s/rad; exclude when drive.kp > 0 V*s/rad;", "D139"),
        ("vary drive.kp = [1, 2] V*s/rad; exclude when drive.kp > 1.5;", "D063"),
        ("vary drive.kp = [1, 2] V*s/rad; exclude when drive.kq > 1 V*s/rad;", "D065"),
        ("vary drive.kp = [1, 2] V*s/rad; exclude when drive.kp;", "D130"),
    ],
)
def test_a_sweep_that_cannot_be_is_told(tmp_path: Path, body: str, code: str) -> None:
    assert swept_codes(tmp_path, body) == [code]


def test_a_sweep_over_what_every_use_overrides_is_an_error(tmp_path: Path) -> None:
    run = changed(RUN, ("hinge = drive;", "hinge = drive { kp = 9 V*s/rad; };"))
    assert swept_codes(tmp_path, "vary drive.kp = [1, 2] V*s/rad;", ARM, run) == ["D137"]


def test_a_let_that_changes_nothing_is_an_error(tmp_path: Path) -> None:
    assert swept_codes(tmp_path, "vary idle = [1, 2] m;", "let idle = 1 m;\n" + ARM) == ["D137"]
    cancelled = "let idle = 1 m;\n" + changed(ARM, ("length = 1 m", "length = 1 m + 0 * idle"))
    assert swept_codes(tmp_path, "vary idle = [1, 2] m;", cancelled) == ["D137"]


def test_values_that_depend_on_what_varies_are_an_error(tmp_path: Path) -> None:
    arm = "let gain = 1 V*s/rad;\n" + ARM
    servo = "vary gain = [1, 2] V*s/rad; vary drive.kp = [gain, 2 * gain];"
    assert "D121" in swept_codes(tmp_path, servo, arm)


def test_a_bad_case_is_named_with_its_coordinates(tmp_path: Path) -> None:
    body = "vary drive.kp = [1, 2] V*s/rad; vary links.bar.mass = [2, 1, -1] kg;"
    compiled = check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ {body} }}", select=["it"])
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.message == "`mass` of link `bar` must be at least 0 kg; case #2 breaks it, and 1 more"
    assert diagnostic.help[0] == "case #2: drive.kp = 1 V*s/rad, links.bar.mass = -1 kg"


def test_excluded_cases_may_be_impossible(tmp_path: Path) -> None:
    body = "vary links.bar.mass = [1, -1] kg; exclude when links.bar.mass < 0 kg;"
    assert swept(tmp_path, body).cases.count == 1


def test_an_inertia_that_becomes_impossible_in_one_case_is_told(tmp_path: Path) -> None:
    arm = changed(ARM, ("shape = rod(length = 1 m, along = x);", "inertia = [1, 1, 1] kg*m^2;"))
    body = "vary links.bar.inertia.zz = [1, 1.5, 2.5] kg*m^2;"
    compiled = check(tmp_path, arm, SERVO, RUN, f"sweep it of hold {{ {body} }}", select=["it"])
    (diagnostic,) = compiled.diagnostics
    assert diagnostic.code == "D087"
    assert "case #2" in diagnostic.message, messages(compiled)


def test_a_comparison_that_rounding_decides_is_warned_of(tmp_path: Path) -> None:
    """0.1 + 0.2 is the double above 0.3."""
    body = "vary drive.kp = [0.1, 0.3] V*s/rad; exclude when drive.kp < (0.1 + 0.2) V*s/rad;"
    compiled = check(tmp_path, ARM, SERVO, RUN, f"sweep it of hold {{ {body} }}", select=["it"])
    assert [d.code for d in compiled.diagnostics][:1] == ["D139"]
    body = "vary drive.kp = [0.1, 0.3, 0.5] V*s/rad; exclude when drive.kp < (0.1 + 0.2) V*s/rad;"
    assert swept_codes(tmp_path, body) == ["D127"]
    body = "vary drive.kp = [0.1, 0.3, 0.5] V*s/rad; exclude when drive.kp < 0.2 V*s/rad;"
    assert swept_codes(tmp_path, body) == []


def test_an_exclusion_that_drops_nothing_is_warned_of(tmp_path: Path) -> None:
    assert swept_codes(tmp_path, "vary drive.kp = [1, 2] V*s/rad; exclude when drive.kp > 3 V*s/rad;") == ["D138"]


def test_a_sweep_has_a_seed_of_its_own(tmp_path: Path) -> None:
    assert swept(tmp_path, "seed = 7; vary drive.kp = [1, 2] V*s/rad;").cases.seed == 7
    assert experiment(tmp_path, ARM, SERVO, changed(RUN, ("duration", "seed = 5; duration"))).cases.seed == 5
    assert swept_codes(tmp_path, "seed = 7.5; vary drive.kp = [1, 2] V*s/rad;") == ["D113"]


@pytest.mark.slow
def test_the_cases_of_a_sweep_that_is_too_large_are_all_counted(tmp_path: Path) -> None:
    axes = "".join(
        f"vary {path} = linspace(1, 2, 10000) {unit}; "
        for path, unit in (("drive.kp", "V*s/rad"), ("drive.ki", "V/rad"), ("drive.ratio", ""))
    )
    compiled = check(tmp_path, ARM, SERVO, RUN, f"sweep all of hold {{ {axes}}}\n", select="all")
    assert [each.message for each in compiled.diagnostics] == ["sweep `all` has 1,000,000,000,000 cases"]


def test_a_sweep_of_very_many_axes_is_read_no_further_than_it_takes(tmp_path: Path) -> None:
    axes = "".join(f"vary hinge.axis.a{n} = [1, 2, 3, 4]; " for n in range(200))
    compiled = check(tmp_path, ARM, SERVO, RUN, f"sweep all of hold {{ {axes}}}\n", select="all")
    assert compiled.diagnostics[0].message == f"sweep `all` has more than {4**16:,} cases"
