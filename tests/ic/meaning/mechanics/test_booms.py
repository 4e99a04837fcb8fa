"""What a boom may not be, is told with a remedy; what it is made of, is the rigid link that it is while straight."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.ic.small_decks import changed, check, experiment, messages

BOOM = """\
arm crane {
    link jib boom {
        mass = 84 kg;  shape = box(size = [7, 0.2, 0.1] m, along = x);
        EI = [3e6, 1e6] N*m^2;  GJ = 1e6 N*m^2;  damping_ratio = 1 %;
    }
    link hook { mass = 5 kg;  shape = sphere(radius = 0.1 m); }
    joint luff revolute { parent = base;  child = jib;  axis = y; }
    joint end fixed { parent = jib;  child = hook;  at = [7, 0, 0] m; }
}
servo bearing { model = passive; }
run hang {
    arm = crane;
    servos { luff = bearing; }
    rates { dynamics = 10 kHz;  record = 100 Hz; }
    integrator = rk4;
    duration = 1 s;
    record = [q];
}
"""


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("GJ = 1e6", "com = [3, 0, 0] m;  GJ = 1e6"), "a boom is uniform, and this is its `com`"),
        (("GJ = 1e6", "nodes = 3;  GJ = 1e6"), "a boom bends at an even number of nodes"),
        (("box(size = [7, 0.2, 0.1] m, along = x)", "sphere(radius = 1 m)"), "no shape that says how long it is"),
        (("box(size = [7, 0.2, 0.1] m, along = x)", "rod(length = 7 m, along = x)"), "no inertia to twist with"),
        (("at = [7, 0, 0] m", "at = [3, 0, 0] m"), "joint `end` is on boom `jib`, and not at its tip"),
        (("at = [7, 0, 0] m", ""), "0 m is on piece `jib_0`"),
        (("damping_ratio = 1 %;", ""), "damping_ratio"),
        (("mass = 84 kg;", "mass = 0 kg;"), "boom `jib` has no mass"),
        (("EI = [3e6, 1e6] N*m^2;", "EI = 0 N*m^2;"), "`EI` of link `jib` must be above 0"),
        (("EI = [3e6, 1e6] N*m^2;", "EI = [1e6, -1] N*m^2;"), "must be above 0"),
        (("[7, 0.2, 0.1] m", "[0, 0.2, 0.1] m"), "must be above 0"),
        (("luff = bearing;", "luff = bearing;  jib_1y = bearing;"), "`jib_1y` is a spring of a boom"),
        (
            ("    rates", "    environment { w = wrench { link = jib;  force = [0, 0, 9] N; } }\n    rates"),
            "`w` is on boom",
        ),
        (
            ("    rates", "    environment { b = brake { joint = jib_1y;  torque = 1 N*m; } }\n    rates"),
            "no joint `jib_1y`",
        ),
        (("link jib boom {", "link jib boom long {"), "after the name of a link"),
        (("[7, 0.2, 0.1] m, along = x)", "[7, 0.2, 0.1] m, along = w)"), "along"),
        (("joint luff", "joint jib_1z"), "boom `jib` has a part `jib_1z` of its own"),
        (("link jib boom {", "link jib beam {"), "or `link jib boom { ... }`, of a link that bends"),
        (
            ("    rates", "    payload box { mass = 9 kg;  shape = sphere(radius = 0.1 m);  on = jib; }\n    rates"),
            "D084",
        ),
    ],
)
def test_a_boom_that_cannot_be_is_told(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    found = check(tmp_path, changed(BOOM, change))
    assert found.plan is None and message in messages(found)


def test_the_pieces_together_are_the_straight_link(tmp_path: Path) -> None:
    """Mass, first moment and inertia about the centre; and the frames of all pieces are the link's."""
    made = experiment(tmp_path, BOOM)

    def number(path: str) -> float:
        value = made.parameters[path].value
        assert isinstance(value, float)
        return value

    pieces = [f"links.jib_{piece}" for piece in range(5)]
    masses = np.array([number(f"{piece}.mass") for piece in pieces])
    coms = np.array([number(f"{piece}.com.x") for piece in pieces])
    assert masses.sum() == pytest.approx(84.0, rel=1e-15) and masses @ coms == pytest.approx(84.0 * 3.5, rel=1e-15)
    for axis, moved in (("xx", 0.0), ("yy", 1.0), ("zz", 1.0)):
        own = sum(number(f"{piece}.inertia.{axis}") for piece in pieces)
        whole = number(f"links.jib.inertia.{axis}")
        assert own + moved * (masses @ (coms - 3.5) ** 2) == pytest.approx(whole, rel=1e-14)
    assert {number(f"{joint.name}.at.x") for joint in made.structure.joints} == {0.0, 7.0}
    assert [link.name for link in made.structure.straight.links] == ["jib", "hook"]
    assert number("jib_1y.servo.stiffness") == pytest.approx(3e6 * 4.0 / 7.0, rel=1e-15)
    assert number("jib_1z.servo.stiffness") == pytest.approx(1e6 * 4.0 / 7.0, rel=1e-15)


PIECE = (
    "joint luff",
    "link eye { mass = 1 kg;  shape = sphere(radius = 0.1 m); }\n"
    "    joint clamp fixed { parent = jib_2;  child = eye;  at = [3, 0, 0] m; }\n    joint luff",
)
MOMENT = ("    rates", "    environment { w = wrench { link = jib;  moment = [0, 9, 0] N*m; } }\n    rates")


@pytest.mark.parametrize("changes", [(), (PIECE,), (MOMENT,)])
def test_decks_of_sane_booms_are_not_warned_of(tmp_path: Path, changes: tuple[tuple[str, str], ...]) -> None:
    assert not check(tmp_path, changed(BOOM, *changes)).diagnostics


def test_where_a_spring_begins_is_lost_in_a_balanced_start(tmp_path: Path) -> None:
    begins = ("    rates", "    initial { jib_1y.q = 1 deg;  servos = balanced; }\n    rates")
    assert "warning[D248]: `jib_1y.q` changes nothing" in messages(check(tmp_path, changed(BOOM, begins)))


def test_a_stubby_boom_is_told(tmp_path: Path) -> None:
    assert "a tube of 5 widths" in messages(check(tmp_path, changed(BOOM, ("[7, 0.2, 0.1] m", "[7, 2, 2] m"))))


RECORDED = (
    ("record = [q];", "record = [q, links.jib.deflection, jib_1y.q];  signal way = abs(links.jib.deflection.z);"),
    ("    arm = crane;", "    arm = crane;  metric most = max { of = links.jib.bend.y; }"),
)


def test_what_only_a_boom_has_names_the_word_and_no_channel_is_missed_besides(tmp_path: Path) -> None:
    plain = changed(BOOM, ("link jib boom", "link jib"), *RECORDED)
    found = check(tmp_path, plain).diagnostics
    assert [each.message for each in found] == [f"link `jib` has no `{n}`" for n in ("EI", "GJ", "damping_ratio")]
    assert all("write `link NAME boom { ... }`, with its `EI`" in str(each.help[0]) for each in found)


def test_no_channel_is_missed_of_a_boom_that_has_a_mistake(tmp_path: Path) -> None:
    assert [each.code for each in check(tmp_path, changed(BOOM, *RECORDED)).diagnostics] == []
    for wrong in ("EI = [3e6, 1e6] N*m^2;  nodes = 3;", "EI = 3e6 N*m^2;  EJ = 2;", "EI = 3 N;"):
        said = check(tmp_path, changed(BOOM, ("EI = [3e6, 1e6] N*m^2;", wrong), *RECORDED)).diagnostics
        assert len(said) == 1 and said[0].code != "D125", wrong
    tube = changed(BOOM, ("EI = [3e6, 1e6] N*m^2;", "EI = 3e6 N*m^2;  tube = 3;"))
    assert "write `EI`: of a tube of radius r and wall t it is E pi r^3 t" in messages(check(tmp_path, tube))


@pytest.mark.parametrize(
    ("path", "unit", "instead"),
    [
        ("jib_1y.servo.stiffness", "N*m/rad", "links.jib.EI"),
        ("jib_3x.servo.stiffness", "N*m/rad", "links.jib.GJ"),
        ("jib_2z.servo.damping", "N*m*s/rad", "links.jib.damping_ratio"),
    ],
)
def test_no_number_of_one_spring_varies_or_is_set_alone(tmp_path: Path, path: str, unit: str, instead: str) -> None:
    one = changed(BOOM, ("[3e6, 1e6] N*m^2", "3e6 N*m^2"))
    said = messages(check(tmp_path, f"{one}sweep soft of hang {{ vary {path} = [1, 2] {unit}; }}\n", select="all"))
    assert f"error[D122]: `{path}` cannot vary" in said
    assert f"it follows from the boom; vary `{instead}`" in said
    said = messages(check(tmp_path, one, set=[f"{path}=1 {unit}"]))
    assert f"error[D235]: `{path}` cannot be set" in said and f"set `{instead}`" in said
    numbers = {"EI": "1e6 N*m^2", "GJ": "2e6 N*m^2", "damping_ratio": "3 %"}[instead.rpartition(".")[2]]
    assert check(tmp_path, one, set=[f"{instead}={numbers}"]).diagnostics == ()
