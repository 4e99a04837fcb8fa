"""Channels of a few joints and links alone are those that a structure has of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from met.plan import Structure
from met.plan.channel import channels, channels_beside, recordable
from tests.ic.small_decks import SERVO, changed, experiment

RUN = """\
arm swing {
    link rod { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    link tip { mass = 1 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = rod;  axis = z; }
    joint slide prismatic { parent = rod;  child = tip;  at = [1, 0, 0] m;  axis = x; }
}
run it {
    arm = swing;  servos { hinge = drive; }
    rates { dynamics = 1 kHz;  servos = 250 Hz; }
    duration = 1 s;  record = [q];
    signal apart = slide.qd / (1 m/s) - hinge.servo.command / (1 rad/s);
    metric far = max { of = links.tip.position.x; }
    metric off = max { of = abs(signals.apart); }
}
"""


def structure(folder: Path) -> Structure:
    return experiment(folder, SERVO, RUN).structure


def test_a_channel_by_its_path_is_the_one_among_all(tmp_path: Path) -> None:
    run = structure(tmp_path)
    known = channels(run)
    assert {"hinge.servo.command", "slide.qd", "links.tip.rate.z", "energy.kinetic", "signals.apart"} <= known.keys()
    for path, channel in known.items():
        assert channels_beside(run, [path])[path] == channel


def test_of_other_joints_and_links_there_is_none_beside_it(tmp_path: Path) -> None:
    run = replace(structure(tmp_path), metrics=(), expressions=())
    known = channels(run)
    of_hinge = channels_beside(run, ["hinge.q"])
    assert {path for path in known if path.startswith("hinge.")} <= of_hinge.keys() < known.keys()
    assert not any(path.startswith(("slide.", "links.tip.")) for path in of_hinge)
    of_tip = channels_beside(run, ["links.tip.rate.x"])
    assert {path for path in known if path.startswith("links.tip.")} <= of_tip.keys()
    assert not any(path.startswith(("hinge.", "slide.")) for path in of_tip)


def test_channels_of_all_joints_and_links_by_their_paths_are_all_channels(tmp_path: Path) -> None:
    run = structure(tmp_path)
    paths = [*(f"{joint.name}.q" for joint in run.moving), *(f"links.{link.name}.rate.x" for link in run.links)]
    assert channels_beside(run, paths) == channels(run, paths)


def test_what_can_be_recorded_follows_from_the_channels(tmp_path: Path) -> None:
    run = structure(tmp_path)
    names = ["links.tip.jacobian.linear.slide"]
    assert recordable(run, known=channels(run, names)) == recordable(run, names)
    bare = replace(run, record=(), metrics=(), expressions=())
    assert names[0] in recordable(bare, known=channels(bare, names))
    assert names[0] not in recordable(bare)


def test_the_names_that_are_wanted_alone_are_what_they_are_among_all(tmp_path: Path) -> None:
    run = structure(tmp_path)
    every = recordable(run)
    for name in every.keys() - {"sensors"}:
        assert recordable(run, wanted=[name]) == {name: every[name]}
    assert {"q", "reaction", "energy", "links.tip.position", "hinge.reaction.force.x"} <= every.keys()
    assert recordable(run, wanted=["nothing", "q"]) == {"q": every["q"]}


def test_a_jacobian_that_only_the_record_names_is_recorded(tmp_path: Path) -> None:
    only = changed(RUN, ("record = [q]", "record = [links.tip.jacobian.linear.slide]"))
    (recorded,) = experiment(tmp_path, SERVO, only).structure.record
    assert recorded.name == "links.tip.jacobian.linear.slide"
