"""Grapples that no gripper makes are warned of once the cases are run, and others are not."""

from __future__ import annotations

from pathlib import Path

import pytest

import batch
import ic
from batch.archive.read import ArchiveFile
from batch.queries.warnings import campaign_warnings
from met.diagnostic import Diagnostic

DECK = """\
arm a {
    link b { mass = 1 kg; shape = box(size = [0.2, 0.1, 0.1] m); }
    joint j revolute { parent = base; child = b; axis = z; }
}
run r {
    arm = a;
    payload p { mass = 1 kg; shape = sphere(radius = 5 cm); on = b; at = [0.1, 0, 0] m; grapple = 0.5 s;
                position = [0.1, 0, 0] m; }
    rates { dynamics = 1 kHz; }  duration = 1 s;  record = [q];
}
run beside like r { p { position = [0.1, 0.31, 0] m; } }
run fast like r { p { position = [0.1, -1, 0] m;  velocity = [0, 2, 0] m/s; } }
run turning like r { p { rate = [0, 0, 12] rad/s; } }
run gentle like r { p { position = [0.1, -0.05, 0] m;  velocity = [0, 0.2, 0] m/s;  rate = [0, 0, 1] rad/s; } }
run late like fast { p { grapple = 2 s; } }
run meant like fast { allow D347 because "a hammer"; }
run afar like r { p { position = [1000, 0, 0] m; } }
sweep offsets of beside { vary payloads.p.position.y = [0, 0.1, 0.3, 0.2] m; }
"""


def warned(folder: Path, run: str) -> list[Diagnostic]:
    (folder / "d.ic").write_text(DECK, encoding="utf-8")
    plan = ic.compile(folder / "d.ic", select=[run])
    path = batch.run(plan, output=folder / "a.h5", verify="none").path
    with ArchiveFile(path) as file:
        return campaign_warnings(file.groups, {each.name: each for each in plan.experiments})


@pytest.mark.slow
def test_a_payload_beside_its_place_is_told_with_the_distance(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "beside")
    assert (found.code, found.severity) == ("D347", "warning")
    assert found.message == (
        "payload `p` is grappled 0.31 m from its place: momentum is kept, and 0 J are lost at once"
    )
    assert found.at is not None and found.at.place.line == 7
    assert found.help == (
        "let it be there by then: change its `position`, `velocity` or `grapple`, or the arm's motion; "
        "`payloads.p.distance` is how far it is",
    )


@pytest.mark.slow
def test_a_payload_that_flies_past_is_told_with_its_speed_and_the_energy(tmp_path: Path) -> None:
    """Its angular momentum about the hinge is kept; the box's middle is 0.1 m from there, as the payload is."""
    [found] = warned(tmp_path, "fast")
    lever = 0.1
    inertia = (0.2**2 + 0.1**2) / 12.0 + 1.0 * lever**2
    together = inertia + 1.0 * lever**2 + 0.4 * 0.05**2
    lost = 0.5 * 2.0**2 - 0.5 * (2.0 * lever) ** 2 / together
    assert found.message == (
        f"payload `p` is grappled at 2 m/s against its link: momentum is kept, and {lost:.4g} J are lost at once"
    )
    assert found.help == ("let the link go along with it by then: no gripper closes on what moves so fast",)


@pytest.mark.slow
def test_a_payload_that_turns_fast_is_told(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "turning")
    assert found.message.startswith("payload `p` is grappled at 12 rad/s against its link: momentum is kept, and ")


@pytest.mark.release
@pytest.mark.parametrize("run", ["r", "gentle", "late", "meant"])
def test_what_a_gripper_makes_is_not_told_nor_what_never_comes_or_is_meant(tmp_path: Path, run: str) -> None:
    assert warned(tmp_path, run) == []


@pytest.mark.slow
def test_what_the_check_tells_is_not_told_again(tmp_path: Path) -> None:
    assert warned(tmp_path, "afar") == []
    assert [each.code for each in ic.check(tmp_path / "d.ic", select=["afar"]).diagnostics] == ["D339"]


@pytest.mark.slow
def test_of_a_campaign_there_is_one_warning_with_the_count_and_the_worst_case(tmp_path: Path) -> None:
    [found] = warned(tmp_path, "offsets")
    assert found.message.startswith("payload `p` is grappled 0.3 m from its place, in 2 of 4 cases, worst in #2: ")
    data = batch.open(tmp_path / "a.h5")
    assert data["grapple.p.distance"].values.tolist() == pytest.approx([0.0, 0.1, 0.3, 0.2])
    assert data["grapple.p.distance"].attrs["units"] == "m"
    assert data["grapple.p.energy"].attrs["units"] == "J"
