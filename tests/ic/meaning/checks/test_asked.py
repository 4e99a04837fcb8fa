"""What is asked of a run, far from what its commands and its sweep can give, is remarked on; what is near is not."""

from __future__ import annotations

import pytest

from tests.ic.meaning.checks.test_scales import PUSH, TWO_LINKS, remarks

SETTLED = "settling_time(of = elbow.q, target = 60 deg, band = 2 %)"
STOPPED = (
    "command = position(trapezoid(start = 0 deg, to = 60 deg, max_rate = 0.8 rad/s, max_acceleration = 2 rad/s^2));"
)
PLACE = "at = [0.6, 0, 0] m;"
NEVER = "is asked for leads from 0 to 60 deg; a servo goes where it is asked to"


@pytest.mark.parametrize(("target", "told"), [("60", 0), ("61", 0), ("30", 0), ("0", 0), ("62", 1), ("75", 1)])
def test_a_target_to_which_no_command_leads_is_told(target: str, told: int) -> None:
    """Within the band of 2 % of what the command leads to, and on the way there, nothing is."""
    found = remarks(("target = 60 deg", f"target = {target} deg"))
    wait = "look at the joint that is meant, or wait for what this one's leads to"
    assert found == [(f"`metrics.late.target` is {target} deg, and what `elbow` {NEVER}", (wait,))] * told


def test_the_joint_whose_command_leads_to_a_target_is_named_and_is_the_remedy() -> None:
    stands = ("shoulder = drive; elbow = drive;", "shoulder = drive; elbow = drive { command = position(0 deg); }")
    assert remarks(stands) == [
        (
            "`metrics.late.target` is 60 deg, and what `elbow` is asked for leads to 0 deg; a servo goes where it is "
            "asked to",
            ("look at `shoulder.q`, whose command leads there, or wait for what this one's leads to",),
        )
    ]
    assert remarks(stands, ("of = elbow.q", "of = shoulder.q")) == []


@pytest.mark.parametrize(
    ("command", "metric", "told"),
    [
        ("rate(0.2 rad/s)", "settling_time(of = elbow.qd, target = 0.2 rad/s)", False),
        ("rate(0.2 rad/s)", "settling_time(of = elbow.qd, target = 0.3 rad/s)", True),
        ("rate(0.2 rad/s)", "settling_time(of = elbow.q, target = 0.6 rad)", False),
        ("rate(0.2 rad/s)", "overshoot(of = elbow.q, target = 0.7 rad)", True),
    ],
)
def test_where_a_rate_leads_counts(command: str, metric: str, told: bool) -> None:
    unread = ("sensor q = encoder { step = 0.0001 rad; }", "")
    found = remarks(unread, (STOPPED, f"command = {command};"), (SETTLED, metric))
    assert ["metrics.late.target" in said for said, _ in found] == [True] * told


FLIES = (
    "payload tool { on = fore; at = [0.4, 0, 0] m; mass = 1 kg; inertia = [1e-3, 1e-3, 1e-3] kg*m^2; }",
    "payload tool { on = fore; at = [0.4, 0, 0] m; mass = 1 kg; shape = sphere(radius = 1 cm); grapple = T s; "
    "position = [P] m; }",
)


@pytest.mark.parametrize(
    ("time", "place", "apart", "there"),
    [
        ("0", "1, 0, 0", None, ""),
        ("0", "1, 0.2, 0", None, ""),
        ("0", "1, 0.4, 0", "0.4", "1, 0, 0"),
        ("2.9", "1, 0, 41.26", "1.255", "0.1, 0, -0.866"),  # it has fallen to where the arm was
    ],
)
def test_a_payload_that_its_grapple_misses_is_told(time: str, place: str, apart: str | None, there: str) -> None:
    def found(place: str) -> list[tuple[str, tuple[str, ...]]]:
        return remarks((FLIES[0], FLIES[1].replace("T s", f"{time} s").replace("[P]", f"[{place}]")))

    message = (
        f"`payloads.tool.position` leads it {apart} m past its place on `fore`, which grapples it at {time} s; a "
        "grapple closes on what is near"
    )
    remedy = f"its place is at [{there}] m then: let it be there"
    assert found(place) == [(message, (remedy,))] * (apart is not None)
    x, y, z = (float(each) for each in (there or place).split(","))
    assert found(f"{x}, {y}, {z + 0.5 * 9.81 * float(time) ** 2}") == []  # the remedy


@pytest.mark.parametrize(
    ("ends", "limits", "told"),
    [
        ("(-180, 180) deg", "", False),
        ("(-5, 5) rad", "", True),
        ("(-5, 5) rad", " q_min = -6 rad;  q_max = 6 rad;", False),
    ],
)
def test_starts_over_more_than_a_turn_are_told_unless_the_joint_has_that_range(
    ends: str, limits: str, told: bool
) -> None:
    sweep = f"sweep s of lift {{ seed = 1;  sample random(8) {{ initial.elbow.q = uniform{ends}; }} }}\n"
    found = remarks((f"axis = y; {PLACE}", f"axis = y; {PLACE}{limits}"), text=TWO_LINKS + sweep)
    said = [each for each in found if "`initial.elbow.q` varies over" in each[0]]
    assert len(said) == told
    assert all(helps[0].startswith("in deg it would be 0.02") for _, helps in said)


@pytest.mark.parametrize(
    ("masses", "at", "told"),
    [
        ("1, 1.5", "0, 0, 0", False),  # two thirds of what it would have
        ("1, 4", "0, 0, 0", True),
        ("1, 4", "0.4, 0, 0", False),  # about its joint the inertia hardly counts
    ],
)
def test_an_inertia_that_stays_while_the_mass_varies_is_told_where_it_counts(masses: str, at: str, told: bool) -> None:
    sweep = f"sweep s of lift {{ vary payloads.tool.mass = [{masses}] kg; }}\n"
    found = remarks(("on = fore; at = [0.4, 0, 0] m;", f"on = fore; at = [{at}] m;"), text=TWO_LINKS + sweep)
    assert (
        found
        == [
            (
                "`payloads.tool.inertia` stays 0.001 kg*m^2 while `payloads.tool.mass` varies from 1 to 4 kg; of one "
                "shape, a heavier body has more inertia",
                ("write a `shape`, from which the inertia follows, or let it vary with the mass",),
            )
        ]
        * told
    )
    shape = ("inertia = [1e-3, 1e-3, 1e-3] kg*m^2; }\n    rates", "shape = sphere(radius = 5 cm); }\n    rates")
    assert not told or remarks(shape, text=TWO_LINKS + sweep) == []  # the remedy


def test_a_payload_beside_its_link_by_more_than_the_arm_is_told() -> None:
    link = ("com = [0.2, 0, 0] m; inertia = [0.004, 0.03, 0.03] kg*m^2;", "shape = rod(length = 0.4 m, along = x);")
    hangs, far = (("on = fore; at = [0.4, 0, 0] m;", f"on = fore; at = [0.4, 0, {-z}] m;") for z in (0.9, 1.1))
    light = ("mass = 1 kg; inertia = [1e-3", "mass = 10 g; inertia = [1e-3")
    assert remarks(link, hangs, light) == []
    assert [said for said, _ in remarks(link, far, light)] == [
        "`payloads.tool.at` is beside the shape of `fore` by 1.1 m, 1.1 times the arm's reach, 1 m; a payload is "
        "usually at its link, or hangs from it"
    ]


def test_a_load_motor_too_small_for_the_load_at_the_start_is_told_with_a_current_that_does() -> None:
    def found(current: str, scale: str = "") -> list[tuple[str, tuple[str, ...]]]:
        bed = f"    substitute elbow {{ bed = emulated(i_max = {current}); law = velocity_tracking; {scale} }}\n"
        unread = ("sensor q = encoder { step = 0.0001 rad; }", "")
        return remarks((PUSH, ""), unread, ("    payload", f"{bed}    payload"))

    assert found("0.05 A") == [
        (
            "`elbow.bed.i_max` makes 0.36 N*m at the joint, which gravity loads by 7.848 N*m at the start; a bed brings "
            "its joint's load",
            ("1.101 A would bring it",),
        )
    ]
    assert found("1.101 A") == [] and found("0.05 A", "scale { torque = 25; rate = 25; voltage = 25; }") == []


def test_a_target_that_all_cases_of_a_sweep_over_commands_share_is_not_told() -> None:
    sweep = "sweep s of lift { vary elbow.servo.command.to = [40, 50, 60] deg; }\n"
    assert remarks(text=TWO_LINKS + sweep) == []
