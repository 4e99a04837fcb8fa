"""Numbers and bodies of a size that is not found are warned of, with the unit that may have been meant; others are not."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, codes, shown
from tests.oracles.random_deck import random_deck

BODY = "mass = 2 kg; shape = rod(length = 1 m, along = x);"
ONE = "arm swing {{ link bar {{ {} }} joint hinge revolute {{ parent = base; child = bar; axis = z; {} }} }}\n"


def arm(body: str = BODY, joint: str = "") -> str:
    return ONE.format(body, joint)


def inside(text: str) -> str:
    return changed(RUN, ("duration", f"{text}\n    duration"))


@pytest.mark.parametrize(
    ("body", "said", "cure"),
    [
        ("mass = 2500 kg; com = [150, 0, 0] m; inertia = [3e6, 5e6, 5e6] kg*m^2;",
         "44.72 m (its radius of gyration), and would be of 0.002378 kg/m^3; solids have 1 to 22,600",
         "it would be of 0.04472 m, 2.5 kg and 2378 kg/m^3, were all its numbers in mm and g"),
        ("mass = 2.5 kg; com = [0.15, 0, 0] m; inertia = [3e-12, 5e-12, 5e-12] kg*m^2;",
         "1.414e-06 m (its radius of gyration), and weighs 2.5 kg, more than any solid of that size; a point mass has "
         "`inertia = [0, 0, 0] kg*m^2`",
         "it would be of 0.04472 m, were it 0.005 kg*m^2: was it converted from g*mm^2 twice?"),
        ("mass = 5 kg; com = [0.5, 0, 0] m; inertia = [4e-7, 5e-6, 5e-6] kg*m^2;",
         "0.001 m (its radius of gyration), and weighs 5 kg, more than any solid of that size; a point mass has "
         "`inertia = [0, 0, 0] kg*m^2`",
         "it would be of 0.1 m, were it 0.05 kg*m^2: was it converted from kg*cm^2 twice?"),
    ],
)  # fmt: skip
def test_an_inertia_in_other_units_on_an_arm_in_these_and_one_converted_twice_are_told(
    tmp_path: Path, body: str, said: str, cure: str
) -> None:
    [found] = check(tmp_path, arm(body), SERVO, RUN).diagnostics
    assert found.code == "D298" and found.message == f"link `bar` has the inertia of a body of {said}"
    assert found.help == (cure, "look at the units of its mass and of its inertia", MEANT)


MEANT = 'if it is meant so, `allow D298 because "...";`'


def test_a_body_of_next_to_no_mass_is_endlessly_large_and_no_defect(tmp_path: Path) -> None:
    body = "mass = 1 kg; com = [0.3, 0, 0] m; inertia = [0.2, 0.2, 0.2] kg*m^2;"
    found = check(
        tmp_path, arm(body), SERVO, RUN, "sweep it of hold { vary links.bar.mass = [1e-320, 1] kg; }", select="it"
    )
    assert [each.code for each in found.diagnostics] == ["D297"] and found.plan is not None


@pytest.mark.parametrize(
    ("body", "said", "cure"),
    [
        ("1000 kg; shape = box(size = [1, 1, 1] mm)", "1e+12 kg/m^3", "with sizes 1,000 times larger it would be 1000 kg"),
        ("3000 kg; shape = cylinder(radius = 2 cm, length = 30 cm, along = x)", "7.958e+06 kg/m^3",
         "with 1,000 times less mass it would be 7958 kg/m^3"),
        ("1 kg; shape = sphere(radius = 50 m)", "1.91e-06 kg/m^3", "with a thousandth of the sizes it would be 1910 kg"),
        ("1000 kg; shape = rod(length = 1 mm, along = x)", "1e+06 kg/m", "with 1,000 times less mass it would be 1000 kg/m"),
    ],
)  # fmt: skip
def test_a_body_that_nothing_is_made_of_is_told_with_a_cure(tmp_path: Path, body: str, said: str, cure: str) -> None:
    found = shown(tmp_path, arm(f"mass = {body};"), SERVO, RUN)
    assert f"warning[D298]: link `bar` would be of {said}, and " in found and f"= help: {cure}" in found


@pytest.mark.parametrize(
    ("parts", "path"),
    [
        ((arm("mass = 1 kg; shape = rod(length = 1e6 m, along = x);"), RUN), "links.bar.shape.length"),
        ((arm("mass = 1e-9 kg; shape = rod(length = 1 m, along = x);"), RUN), "links.bar.mass"),
        ((arm("mass = 1 kg; com = [3, 0, 0] km; inertia = [1, 1, 1] kg*m^2;"), RUN), "links.bar.com.x"),
        ((arm(joint="at = [300, 0, 0] m;"), RUN), "hinge.at.x"),
        ((ARM, inside("initial { hinge.qd = 1e5 rad/s; }")), "initial.hinge.qd"),
    ],
)  # fmt: skip
def test_numbers_beyond_what_there_is_are_told(tmp_path: Path, parts: tuple[str, str], path: str) -> None:
    found, run = parts
    said = [each for each in check(tmp_path, found, SERVO, run, select="all").diagnostics if each.code == "D297"]
    assert len(said) == 1 and said[0].message.startswith(f"`{path}` is ")


def test_of_many_numbers_of_one_kind_the_worst_is_told(tmp_path: Path) -> None:
    said = shown(tmp_path, arm(joint="at = [300, 450, 0] m;"), SERVO, RUN)
    assert "warning[D297]: `hinge.at.y` is 450 m, and 1 more is so, and the longest links " in said


def test_one_row_of_a_sweep_is_told(tmp_path: Path) -> None:
    sweep = "sweep s of hold { vary swing.links.bar.mass = [1, 2, 1e-8, 3] kg; }\n"
    assert codes(tmp_path, ARM, SERVO, RUN, sweep, select="s") == ["D297"]
    assert codes(tmp_path, ARM, SERVO, RUN, sweep.replace("1e-8", "1e-3"), select="s") == []


@pytest.mark.parametrize(
    ("body", "code", "said"),
    [
        ("mass = 5 kg; shape = sphere(radius = 0.3 m);", "D298",
         "link `bar` would be of 0.001768 kg/m^3 in case #2 (0.0002 kg), and solids have 1 to 22,600"),
        ("mass = 5 kg; com = [0.3, 0, 0] m; inertia = [0.1, 0.2, 0.2] kg*m^2;", "D297",
         "`links.bar.inertia` has a radius of gyration of 31.62 m in case #2, 105.4 times the arm's reach, 0.3 m; of 620 links of published robots all have 0.00018 to 1.3 times their robot's reach"),
        ("mass = 5 kg; shape = rod(length = 1 m, along = x);", "D297",
         "`links.bar.mass` is 2e-07 kg in case #2, and links weigh a milligram and more, and the largest some 400 t"),
    ],
)  # fmt: skip
def test_a_remark_on_a_sweep_names_the_case(tmp_path: Path, body: str, code: str, said: str) -> None:
    small = "2e-7" if "rod" in body else "2e-4"
    sweep = f"sweep s of hold {{ vary swing.links.bar.mass = [1, 2, {small}, 3] kg; }}\n"
    [found] = check(tmp_path, arm(body), SERVO, RUN, sweep, select="s").diagnostics
    assert found.code == code and found.message == said


@pytest.mark.parametrize("count", [50, 20000])
def test_the_case_that_is_named_is_the_one_that_was_drawn(tmp_path: Path, count: int) -> None:
    """Also of more cases than are looked at as one table."""
    body = "mass = 5 kg; shape = sphere(radius = 3 m);"
    drawn = f"sweep s of hold {{ sample random({count}) {{ swing.links.bar.mass = uniform(0, 500) kg; }} }}\n"
    found = check(tmp_path, arm(body), SERVO, RUN, drawn, select="s")
    [told] = [each for each in found.diagnostics if each.code == "D298"]
    case, mass = re.findall(r" in case #(\d+) \((.*) kg\), and", told.message)[0]
    assert found.plan is not None
    values = np.asarray(found.plan.experiments[0].cases.coordinates[0].values)
    assert values[int(case)] == values.min() and f"{values.min():.4g}" == mass


def test_a_torque_constant_in_milli_is_told(tmp_path: Path) -> None:
    servo = changed(SERVO, ("kt = 0.05", "kt = 600"), ("resistance = 1 ohm", "resistance = 1e8 ohm"))
    assert [code for code in codes(tmp_path, ARM, servo, RUN) if code == "D297"] == [
        "D297"
    ] * 3  # such a motor turns slowly, and never has its largest torque


@pytest.mark.parametrize(
    "body",
    [
        "mass = 1 kg; shape = sphere(radius = 1 cm);",  # a mass that is drawn as a small ball
        "mass = 0 kg;",
        "mass = 1 kg; com = [0, 0, 0] m; inertia = [500, 500, 500] kg*m^2;",  # of no length: its mass does not count
        "mass = 1 kg; com = [0.1, 0, 0] mm; inertia = [1, 1, 1] kg*m^2;",  # a rotor that is nearly balanced
        "mass = 1 kg; com = [0.5, 0, 0] m; inertia = [1e-9, 1e-9, 1e-9] kg*m^2;",  # nearly a point
        "mass = 1 kg; com = [0.5, 0, 0] m; inertia = [2e-5, 3e-5, 3e-5] kg*m^2;",  # a ball of steel, nearly
        "mass = 2 kg; com = [0.5, 0, 0] m; inertia = [0, 0.17, 0.17] kg*m^2;",  # a thin rod
        "mass = 20 kg; shape = box(size = [10, 3, 0.1] m);",  # a panel of solar cells
        "mass = 300 kg; com = [20, 0, 0] m; inertia = [40020, 40020, 80000, -39980, 0, 0] kg*m^2;",  # a mast, 40 m long
        "mass = 400 t; com = [10, 0, 0] m; inertia = [1e8, 2e8, 2e8] kg*m^2;",  # a station
    ],
)
def test_what_is_only_rare_is_not_told(tmp_path: Path, body: str) -> None:
    found = codes(tmp_path, arm(body), SERVO, RUN)
    assert not {"D297", "D298"} & set(found)


def test_an_inertia_that_no_body_of_the_shape_has_is_told_at_the_inertia(tmp_path: Path) -> None:
    body = "mass = 2 kg; shape = box(size = [0.3, 0.1, 0.1] m);\n inertia = [3e3, 2e4, 2e4] kg*m^2;"
    [found] = check(tmp_path, arm(body), SERVO, RUN).diagnostics
    assert found.code == "D297" and found.at is not None and found.at.place.line == 2
    assert "has a radius of gyration of 100 m, 301.5 times the size of its shape, 0.3317 m; of 620 " in found.message
    assert codes(tmp_path, arm(body.replace("3e3", "3e-3").replace("2e4", "2e-2")), SERVO, RUN) == []


def test_a_mistake_in_all_links_is_told_once(tmp_path: Path) -> None:
    two = "arm swing {{ link bar {{ {0} }} link tip {{ {0} }} joint hinge revolute {{ parent = base; child = bar; axis = z; }} "
    two += "joint wrist revolute {{ parent = bar; child = tip; axis = z; at = [0.3, 0, 0] m; }} }}\n"
    dense = two.format("mass = 900 kg; shape = cylinder(radius = 1 mm, length = 30 mm, along = x);")
    [found, _beside_its_shape] = check(tmp_path, dense, SERVO, RUN).diagnostics
    assert found.message == "link `bar` would be of 9.549e+09 kg/m^3, and 1 more is so, and solids have 1 to 22,600"
    large = two.format("mass = 1 kg; com = [0.2, 0, 0] m; inertia = [2e4, 2e4, 2e4] kg*m^2;")
    [found] = check(tmp_path, large, SERVO, RUN).diagnostics
    assert "has a radius of gyration of 141.4 m, 471.4 times the arm's reach, 0.3 m; 1 more is so; " in found.message


def test_one_mistake_is_told_once(tmp_path: Path) -> None:
    """A box of which the sizes are told is not told as a body besides."""
    assert codes(tmp_path, arm("mass = 2 kg; shape = box(size = [400, 80, 80] m);"), SERVO, RUN) == ["D297"]
    assert codes(tmp_path, arm("mass = 1e-9 kg; shape = sphere(radius = 1 m);"), SERVO, RUN) == ["D297"]


def test_it_may_be_allowed(tmp_path: Path) -> None:
    run = inside('environment { gravity = [0, 0, -400] m/s^2; } allow D297 because "a centrifuge";')
    assert codes(tmp_path, ARM, SERVO, run) == []


@pytest.mark.release
@pytest.mark.parametrize("seed", range(40))
def test_random_sane_decks_are_told_nothing_of_it(tmp_path: Path, seed: int) -> None:
    """But that their motors are too weak, too slow or left out, and joints beside shapes: these are drawn apart."""
    found = check(tmp_path, random_deck(seed)).diagnostics
    said = [each.message for each in found if each.code in ("D296", "D297", "D298")]
    drawn_apart = (" meets a load ", " asks for ", " is beside the shape ", " has no servo")
    assert [each for each in said if not any(words in each for words in drawn_apart)] == []
