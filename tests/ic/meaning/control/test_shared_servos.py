"""A servo that is on joints as its definition says is resolved once, and each joint has what it would have by itself."""

from __future__ import annotations

import pytest

from ic.driver.compile import Compiled, check
from ic.meaning.control import servos
from met.plan import file as plan_file

LINKS = """\
let stiff = 0.2 V*s/rad;
arm row {
    link a { mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }
    link b { mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }
    link c { mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }
    link d { mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }
    joint one revolute { parent = base;  child = a;  axis = z; }
    joint two revolute { parent = a;  child = b;  axis = z;  at = [0.2, 0, 0] m; }
    joint three revolute { parent = b;  child = c;  axis = z;  at = [0.2, 0, 0] m; }
    joint four prismatic { parent = c;  child = d;  axis = z; }
}
servo first { model = rigid_gearbox;  ratio = 100;  kp = stiff;  ki = 1 V/rad;  v_max = 24 V;  resistance = 1 ohm;
    kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  command = rate(0.1 rad/s); }
servo drive like first { sensor qd = tachometer { noise = 0.1 rad/s; } }
servo spring { model = passive;  stiffness = 2 N/m; }
run hold { arm = row;  rates { dynamics = 1 kHz;  servos = 1 kHz; }  duration = 1 s;  record = [q];
    servos { one = drive;  two = drive;  three = drive;  four = spring; } }
"""

MORE = [
    "",
    "run again like hold { duration = 2 s; }",
    "run other like hold { servos { two { kp = 0.3 V*s/rad; } } }",
    "run other like hold { with drive.kp = 0.3 V*s/rad; }",
    "run other like hold { with two.servo.kp = 0.3 V*s/rad; }",
    "run other like hold { with stiff = 0.3 V*s/rad; }",
    "sweep over of hold { vary drive.kp = 0.1 .. 0.3 by 0.1 V*s/rad; }",
    "sweep over of hold { vary first.ratio = [90, 100]; }",
    "sweep over of hold { vary three.servo.kp = 0.1 .. 0.3 by 0.1 V*s/rad; }",
    "sweep over of hold { vary stiff = 0.1 .. 0.3 by 0.1 V*s/rad; }",
    "sweep over of hold { vary two.servo = [drive, first]; }",
    "sweep over of hold { vary drive.sensor.qd.noise = [0.1 rad/s, 0.2 rad/s]; }",
    "sweep over of hold { vary drive.rate = [500 Hz, 1 kHz]; }",
    "sweep over of hold { vary drive.command = [1 rad/s, 2 rad/s]; }",
    "sweep over of hold { vary drive.model = [1, 2]; }",
    "run other like hold { servos { four = drive; } }",  # rates of which are none of a prismatic joint
    "run other like hold { servos { two = nothing; } }",
    "servo bad like drive { kp = 1 m; }  run other like hold { servos { two = bad;  three = bad; } }",
    "servo bad like drive { remove kp; }  run other like hold { servos { two = bad;  three = bad; } }",
    "run other like hold { guide path { model = line; }  servos { two = drive; } }",
]


def compiled(text: str) -> Compiled:
    return check("", include_dirs=(), defines=(), select="all", text=text)


@pytest.mark.release
@pytest.mark.parametrize("more", MORE)
def test_all_is_as_if_each_joint_had_its_servo_by_itself(monkeypatch: pytest.MonkeyPatch, more: str) -> None:
    found = compiled(LINKS + more)
    monkeypatch.setattr(servos, "use_shared", lambda scope, item, arm, resolve: resolve(scope, item, arm))
    expected = compiled(LINKS + more)
    assert found.diagnostics == expected.diagnostics
    assert (found.plan is None) == (expected.plan is None)
    if found.plan is not None and expected.plan is not None:
        assert plan_file.dumps(found.plan) == plan_file.dumps(expected.plan)
    for one, other in zip(found.scopes, expected.scopes, strict=True):
        for each in ("auxiliary", "known", "targets", "not_sweepable", "notes", "removed", "joint_kinds"):
            assert repr(getattr(one, each)) == repr(getattr(other, each)), each  # numbers that vary are none to compare
        assert repr(one.parameters) == repr(other.parameters)
        assert repr(one.names.found_names.worth) == repr(other.names.found_names.worth)


@pytest.mark.slow
def test_a_servo_is_resolved_once_for_joints_of_a_kind_in_all_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    joints: list[str] = []
    own = servos._use

    def counted(scope, item, arm):  # type: ignore[no-untyped-def]
        joints.append(item.name)
        return own(scope, item, arm)

    monkeypatch.setattr(servos, "_use", counted)
    text = (
        LINKS + "run again like hold { duration = 2 s; }\nsweep over of again { vary links.a.mass = [1 kg, 2 kg]; }\n"
    )
    assert compiled(text).plan is not None
    assert len(joints) == 2
    joints.clear()
    assert compiled(text.replace("links.a.mass = [1 kg, 2 kg]", "drive.ratio = [90, 100]")).plan is not None
    assert sorted(joints[2:]) == ["one", "three", "two"]
