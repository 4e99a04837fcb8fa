"""What a record may name, and what is said where it names something else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from met import models
from met.plan import Plan, Recorded
from met.plan import file as plan_file
from met.plan.channel import recordable
from tests.ic.small_decks import RUN, SERVO, changed, check, experiment, messages

ARM = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link sled { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    link hook { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    link foot { mass = 1 kg; shape = sphere(radius = 0.1 m); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
    joint rail prismatic { parent = bar; child = sled; axis = x; }
    joint tie fixed { parent = bar; child = hook; at = [1, 0, 0] m; }
    joint stand fixed { parent = base; child = foot; }
}
"""
XYZ = ("x", "y", "z")


def recorded(folder: Path, names: str) -> tuple[Recorded, ...]:
    return experiment(folder, ARM, SERVO, changed(RUN, ("[q]", f"[{names}]"))).structure.record


def shown(folder: Path, names: str) -> str:
    text = messages(check(folder, ARM, SERVO, changed(RUN, ("[q]", f"[{names}]"))))
    assert text.endswith("\n\n1 error\n")
    return text.removesuffix("\n1 error\n")


def brief(found: tuple[Recorded, ...]) -> list[tuple[str, tuple[str, ...], tuple[str, ...], tuple[str, ...]]]:
    return [(each.name, each.joints, each.components, each.unit) for each in found]


def test_names_of_one_number_of_a_vector_and_of_all_joints(tmp_path: Path) -> None:
    both = ("hinge", "rail")
    assert brief(recorded(tmp_path, "J_eff, rail.b, reaction.force, hinge.reaction.force.x, reaction.moment.z")) == [
        ("J_eff", both, (), ("kg*m^2", "kg")),
        ("rail.b", (), (), ("N",)),
        ("reaction.force", both, XYZ, ("N",) * 6),
        ("hinge.reaction.force.x", (), (), ("N",)),
        ("reaction.moment.z", both, (), ("N*m", "N*m")),
    ]
    assert brief(recorded(tmp_path, "links.sled.orientation, links.foot.position.y, momentum.angular")) == [
        ("links.sled.orientation", (), ("w", "x", "y", "z"), ("1",)),
        ("links.foot.position.y", (), (), ("m",)),
        ("momentum.angular", (), XYZ, ("kg*m^2/s",)),
    ]


def test_a_name_that_stands_for_several_variables(tmp_path: Path) -> None:
    found = recorded(tmp_path, "reaction, energy, momentum, links.hook.jacobian, hinge.reaction")
    assert [each.name for each in found] == [
        "reaction.moment",
        "reaction.force",
        "energy.kinetic",
        "energy.potential",
        "momentum.linear",
        "momentum.angular",
        "links.hook.jacobian.angular",
        "links.hook.jacobian.linear",
        "hinge.reaction.moment",
        "hinge.reaction.force",
    ]


def test_a_jacobian_has_the_joints_that_carry_its_link(tmp_path: Path) -> None:
    angular, linear = recorded(tmp_path, "links.sled.jacobian")
    assert angular.joints == ("hinge", "rail") and angular.unit == ("1",) * 3 + ("rad/m",) * 3
    assert linear.unit == ("m/rad",) * 3 + ("1",) * 3
    assert linear.channels == tuple(
        f"links.sled.jacobian.linear.{joint}.{axis}" for joint in ("hinge", "rail") for axis in XYZ
    )
    _, hook, one = recorded(tmp_path, "links.hook.jacobian, links.hook.jacobian.linear.hinge")
    assert hook.joints == ("hinge",) and one.joints == () and one.components == XYZ


def test_every_name_that_a_record_may_write_compiles_and_survives_a_plan_file(tmp_path: Path) -> None:
    structure = experiment(tmp_path, ARM, SERVO, RUN).structure
    variables = {each.name: each for found in recordable(structure).values() for each in found}
    made = experiment(tmp_path, ARM, SERVO, changed(RUN, ("[q]", f"[{', '.join(variables)}]")))
    assert made.structure.record == tuple(variables.values())
    (again,) = plan_file.loads(plan_file.dumps(Plan("deck.ic", (made,)))).experiments
    assert again.structure.record == made.structure.record


def test_a_link_does_not_have_what_a_joint_has(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "links.hook.J_eff")
        == """\
error[D125]: no channel `links.hook.J_eff`
  --> deck.ic:22:15
   |
22 |     record = [links.hook.J_eff];
   |               ^^^^^^^^^^^^^^^^
   = help: channels of `links.hook`: links.hook.position, links.hook.orientation, links.hook.velocity, links.hook.rate, links.hook.jacobian
"""
    )


def test_an_unknown_name_is_answered_with_what_there_is(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "power")
        == """\
error[D125]: no channel `power`
  --> deck.ic:22:15
   |
22 |     record = [power];
   |               ^^^^^
   = help: channels of all joints: q, qd, qdd, tau, tau_load, J_eff, b, mode, reaction, servo.command, servo.voltage, servo.integral, servo.motor_rate, servo.motor_torque
   = help: channels of the arm, and of a link: energy, momentum, links.bar.position, links.bar.orientation, links.bar.velocity, links.bar.rate, links.bar.jacobian
"""
    )


def test_one_variable_recorded_under_two_names(tmp_path: Path) -> None:
    assert (
        shown(tmp_path, "energy.kinetic, energy")
        == """\
error[D040]: `energy.kinetic` is recorded twice
  --> deck.ic:22:31
   |
22 |     record = [energy.kinetic, energy];
   |                               ^^^^^^
  ::: deck.ic:22:15  first
   = help: leave one out
"""
    )


def test_a_metric_watches_one_number(tmp_path: Path) -> None:
    def of(channel: str) -> str:
        return messages(
            check(tmp_path, ARM, SERVO, changed(RUN, ("[q];", f"[]; metric top = max {{ of = {channel}; }}")))
        )

    assert of("links.hook.position.z") == ""
    assert (
        of("links.hook.position")
        == """\
error[D125]: `links.hook.position` is 3 channels
  --> deck.ic:22:42
   |
22 |     record = []; metric top = max { of = links.hook.position; }
   |                                          ^^^^^^^^^^^^^^^^^^^
   = help: a metric watches one of them: `links.hook.position.x`, `links.hook.position.y`, `links.hook.position.z`

1 error
"""
    )
    assert "= help: a metric watches one of them: `hinge.q`, `rail.q`\n" in of("q")
    assert "= help: did you mean `energy.kinetic`?\n" in of("energy.kinetik")


@pytest.mark.parametrize(
    ("declared", "unit"), [("of", "rad/s"), ("of*s", "rad"), ("of/s", "rad/s^2"), ("1", "1"), ("s", "s")]
)
def test_a_metrics_unit_may_be_made_of_that_of_its_channel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, declared: str, unit: str
) -> None:
    """A metric of somebody's own: an integral, in the channel's unit times seconds."""
    found = models.find

    def find(kind: models.Kind, name: str, *place: Any) -> Any:
        model = found(kind, name, *place)
        return replace(model, unit=declared) if name == "final" else model

    monkeypatch.setattr(models, "find", find)
    wanted = "" if unit == "1" else unit
    metric = f"metric area = final {{ of = hinge.qd; }}  require area < 3 {wanted};"
    experiment(tmp_path, ARM, SERVO, changed(RUN, ("duration", f"{metric}\n    duration")))
