"""A link or joint that is as its arm says is resolved once for all runs, and is in each what it would be by itself."""

from __future__ import annotations

import pytest

from ic.driver.compile import Compiled, check
from ic.meaning.mechanics import arm
from met.plan import file as plan_file

DECK = """\
let heavy = 1 kg;
let twice = 2 * heavy;
let far = 0.2 m;
arm row {
    link a { mass = heavy;  shape = rod(length = far, along = x); }
    link b { mass = twice;  shape = rod(length = 0.3 m, along = x); }
    link c { mass = 1 kg;  com = [0.1, 0, 0] m;  inertia = [1, 1, 1] kg*m^2; }
    joint one revolute { parent = base;  child = a;  axis = [0, 0.6, 0.8]; }
    joint two revolute { parent = a;  child = b;  axis = z;  at = [far, 0 m, 0 m]; }
    joint three prismatic { parent = b;  child = c;  axis = -x;  q_min = -1 m;  q_max = 1 m; }
}
servo drive { model = rigid_gearbox;  ratio = 100;  kp = 0.2 V*s/rad;  ki = 1 V/rad;  v_max = 24 V;
    resistance = 1 ohm;  kt = 0.05 N*m/A;  tau_max = 1 N*m;  j_m = 1e-4 kg*m^2;  command = rate(0.1 rad/s); }
run hold { arm = row;  rates { dynamics = 1 kHz;  servos = 1 kHz; }  duration = 1 s;  record = [q];
    servos { one = drive;  two = drive; } }
"""

MORE = [
    "",
    "run again like hold { duration = 2 s; }",
    "run other like hold { with heavy = 2 kg; }",
    "run other like hold { with links.b.mass = 2 kg; }",
    "run other like hold { with two.at.x = 0.3 m; }",
    "sweep over of hold { vary heavy = [1 kg, 2 kg]; }",
    "sweep over of hold { vary far = [0.1 m, 0.2 m]; }",
    "sweep over of hold { vary links.a.mass = [1 kg, 2 kg];  vary three.q_max = [1 m, 2 m]; }",
    "sweep over of hold { vary links.b.shape.length = [0.1 m, 0.2 m]; }",
    "sweep over of hold { vary links.c.inertia.xx = [1 kg*m^2, 1.5 kg*m^2]; }",
    "sweep over of hold { vary one.axis.x = [0, 0.1]; }",
    "sweep over of hold { vary two.at.x = [0.1 m, 0.2 m];  vary drive.ratio = [90, 100]; }",
    "sweep over of hold { vary links.a.mass = [-1 kg, 2 kg]; }",
    "sweep over of hold { vary two.parent = [1, 2]; }",
    "sweep over of hold { vary links.d.mass = [1 kg, 2 kg]; }",
    "arm odd like row { link a { mass = -1 kg; } }  run other like hold { arm = odd; }",
    "arm odd like row { link d { mass = 1 kg; } }  run other like hold { arm = odd; }",
]


def compiled(text: str) -> Compiled:
    return check("", include_dirs=(), defines=(), select="all", text=text)


@pytest.mark.release
@pytest.mark.parametrize("more", MORE)
def test_all_is_as_if_each_run_resolved_its_arm(monkeypatch: pytest.MonkeyPatch, more: str) -> None:
    found = compiled(DECK + more)
    monkeypatch.setattr(arm, "_shared", lambda scope, definition: None)
    expected = compiled(DECK + more)
    assert found.diagnostics == expected.diagnostics
    assert (found.plan is None) == (expected.plan is None)
    if found.plan is not None and expected.plan is not None:
        assert plan_file.dumps(found.plan) == plan_file.dumps(expected.plan)
    for one, other in zip(found.scopes, expected.scopes, strict=True):
        for each in ("auxiliary", "known", "targets", "not_sweepable", "notes", "removed", "joint_kinds"):
            assert repr(getattr(one, each)) == repr(getattr(other, each)), each  # numbers that vary are none to compare
        assert repr(one.parameters) == repr(other.parameters)
        assert repr(one.names.found.worth) == repr(other.names.found.worth)


def test_a_sweep_resolves_again_what_it_varies_and_what_is_made_of_that(monkeypatch: pytest.MonkeyPatch) -> None:
    resolved: list[str] = []
    for name in ("resolve_link", "_joint"):
        own = getattr(arm, name)

        def counted(scope, item, *rest, own=own):  # type: ignore[no-untyped-def]
            resolved.append(item.name)
            return own(scope, item, *rest)

        monkeypatch.setattr(arm, name, counted)
    assert compiled(DECK + "run again like hold { duration = 2 s; }").plan is not None
    assert resolved == ["a", "b", "c", "one", "two", "three"]
    resolved.clear()
    assert compiled(DECK + "sweep over of hold { vary heavy = [1 kg, 2 kg]; }").plan is not None
    assert resolved[6:] == ["a", "b"]
    resolved.clear()
    assert compiled(DECK + "sweep over of hold { vary far = [0.1 m, 0.2 m]; }").plan is not None
    assert resolved[6:] == ["a", "two"]
