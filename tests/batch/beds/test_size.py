"""`met bed size`: its figures in closed form, its verdicts by planted motors, and what it says."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from batch.beds.bed_size import filter_range
from batch.beds.sizing import Candidate, MotorFigures, PartVerdict, corners, gather, hottest, judge_part
from hw.motor_parts import MotorPart
from met import cli
from met.analysis.margin import margins
from met.analysis.shaft_work import ShaftWork
from tests.met.analysis.test_shaft_work import PUSHED, compiled, work

DECK = (
    PUSHED
    + """
run held like push { duration = 0.1 s;  substitute swing { bed = emulated(kt_load = 0.02 N*m/A, i_max = 1 A); } }
sweep heavier of push { vary links.disk.inertia.zz = [0.3, 0.6, 0.15] kg*m^2; }
"""
)
ON_BED = """#include <servos/rigid_gearbox.ic>
arm one {{
    link beam {{ mass = {mass} kg;  com = [1, 0, 0] m;  inertia = [1e-3, 1e-3, 1e-3] kg*m^2; }}
    joint swing revolute {{ parent = base;  child = beam;  axis = z; }}
}}
servo gearbox like rigid_gearbox {{ command = rate(0.03 rad/s); }}
run bench {{
    arm = one;  servos {{ swing = gearbox; }}  rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    duration = 0.2 s;  record = [q];  substitute swing {{ law = {law}; }}
}}
"""
Bed = Callable[..., tuple[int, str, str]]

# of the pushed disk: N = 50, J_m = 1e-4, I = 0.3, tau = 2 N m at the joint for 2 s
W = 50.0 * 2.0 / 0.55 * 2.0
LOAD = 0.3 / 50.0 * 2.0 / 0.55


def sized(met_bed: Bed, *words: str, status: int = 0) -> dict[str, Any]:
    got, out, err = met_bed("size", "deck.ic", *words, "--format", "json")
    assert (got, err) == (status, "")
    [found] = json.loads(out)
    assert isinstance(found, dict)
    return found


@pytest.mark.slow
def test_a_pushed_disk_has_all_its_figures_in_closed_form(met_bed: Bed) -> None:
    found = sized(met_bed, "push", "--joint", "swing", "--margin", "2")
    drive, load = found["drive"]["figures"], found["load"]["figures"]
    close = {"rel": 3e-5}
    for name, value in {
        "torque_rms": 0.04,
        "torque_peak": 0.04,
        "rate": W,
        "power_peak": 0.04 * W,
        "power_mean": 0.04 * W / 2.0,
        "current_rms": 4.0,
        "current_peak": 4.0,
        "voltage": 100.0 * 4.0 + 0.01 * W,
    }.items():
        assert drive[name]["value"] == pytest.approx(value, **close), name
        assert drive[name]["order"] == 2.0 * drive[name]["value"]
    assert drive["returned_energy"]["value"] == drive["returned_peak"]["value"] == 0.0
    for name, value in {
        "torque_rms": LOAD,
        "torque_peak": LOAD,
        "rate": W,
        "returned_peak": LOAD * W,
        "returned_energy": 0.5 * 0.3 * (W / 50.0) ** 2,  # what the disk would have
    }.items():
        assert load[name]["value"] == pytest.approx(value, **close), name
    assert load["power_peak"]["value"] == load["power_mean"]["value"] == 0.0
    assert found["both"]["returned_energy"]["value"] == 0.0
    assert [one["value"] for one in found["r"]] == pytest.approx([1.2, 1.2], rel=1e-12)
    assert (drive["rate"]["time"], drive["rate"]["case"]) == (2.0, 0)
    assert "current_rms" not in load  # no deck says which load motor
    assert found["drive"]["curve"]["driving"] == pytest.approx([0.04] * 12, rel=1e-4)
    assert found["load"]["curve"]["braking"] == pytest.approx([LOAD] * 12, rel=1e-4)
    assert found["load"]["curve"]["rate"][-1] == pytest.approx(W, **close)


@pytest.mark.slow
def test_each_figure_is_of_the_case_and_the_instant_where_it_is_largest(met_bed: Bed) -> None:
    """The lightest disk is the fastest, the heaviest asks most of the load."""
    found = sized(met_bed, "heavier", "--joint", "swing")
    assert found["cases"] == 3
    assert (found["drive"]["figures"]["rate"]["case"], found["drive"]["figures"]["rate"]["time"]) == (2, 2.0)
    assert found["load"]["figures"]["torque_rms"]["case"] == 1
    assert [one["case"] for one in found["r"]] == [2, 1]
    assert [one["value"] for one in found["r"]] == pytest.approx([0.6, 2.4], rel=1e-12)


@pytest.mark.slow
def test_a_bed_of_the_deck_says_the_load_s_current_and_when_it_is_at_its_limit(met_bed: Bed) -> None:
    found = sized(met_bed, "held")
    load = found["load"]["figures"]
    assert found["in_deck"]
    assert load["current_peak"]["value"] == pytest.approx(load["torque_peak"]["value"] / 0.02, rel=1e-12)
    assert found["limited"] == 1  # 0.0218 N m want 1.09 A
    assert any("at its limit in 1 of 1 cases" in note for note in found["notes"])


def test_a_square_wave_heats_a_winding_as_its_closed_form_says() -> None:
    """On for a and off for b of a period: at its hottest (1 - exp(-a/c))/(1 - exp(-(a + b)/c)) of the square."""
    time = np.linspace(0.0, 10.0, 10001)
    torque = np.where(time < 3.0, 2.0, 0.0)[None, :]
    for constant in (0.5, 3.0, 60.0):
        share = (1.0 - math.exp(-3.0 / constant)) / (1.0 - math.exp(-10.0 / constant))
        assert hottest(torque, time, constant)[0] == pytest.approx(2.0 * math.sqrt(share), rel=1e-9)
    assert hottest(torque, time, 1e6)[0] == pytest.approx(2.0 * math.sqrt(0.3), rel=1e-5)  # its root mean square


def test_corners_are_the_points_that_no_other_exceeds_in_both() -> None:
    points = np.random.default_rng(7).random((400, 2))
    kept = {tuple(each) for each in corners(points).tolist()}
    exceeded = ((points[None] >= points[:, None]).all(2) & (points[None] > points[:, None]).any(2)).any(1)
    assert kept == {tuple(each) for each in points[~exceeded].tolist()}


ROOMY = {
    "torque_rated": 1.0, "torque_peak": 1.0, "rate_max": 1e4, "voltage": 100.0, "current_rated": 100.0,
    "current_peak": 100.0, "inertia": 1e-9, "kt": 0.02, "resistance": 1.0,
}  # fmt: skip


def judged(work: ShaftWork, role: str, *, beside: float | None = None, **figures: float) -> PartVerdict:
    """A planted motor that has room for all but these figures, at a margin of 1.5."""
    part = MotorPart("planted", "planted", figures={**ROOMY, **figures})
    candidate = Candidate(role, MotorFigures(part), beside)
    gather([work], [candidate])
    return judge_part(candidate, 1.5)


@pytest.fixture(scope="module")
def pushed() -> ShaftWork:
    return work(compiled(PUSHED, "push"), "swing")


@pytest.mark.parametrize(
    ("figure", "asked", "what"),
    [
        ("torque_rated", 0.04, "torque, continuous"),
        ("torque_peak", 0.04, "torque, peak"),
        ("rate_max", W, "rate"),
        ("voltage", 2.0 + 0.02 * W, "voltage"),
        ("current_rated", 2.0, "current, continuous"),
        ("current_peak", 2.0, "current, peak"),
    ],
)
def test_a_motor_fits_up_to_the_figure_that_binds(pushed: ShaftWork, figure: str, asked: float, what: str) -> None:
    for share in (0.99, 1.01):
        verdict = judged(pushed, "drive", **{figure: 1.5 * asked / share})
        assert verdict.binds is not None
        assert (verdict.fits, verdict.binds.what) == (share < 1.0, what)
        assert verdict.binds.share == pytest.approx(share, rel=1e-4)


def test_of_a_case_that_failed_counts_what_it_had_until_then(pushed: ShaftWork) -> None:
    """Half of the way: half of the rate, a quarter of the energy; and a case that never began counts for nothing."""
    names = ("rate", "acceleration", "drive", "voltage", "load", "arm")
    half = {name: np.where(pushed.time <= 1.0, getattr(pushed, name), np.nan) for name in names}
    none = {name: np.full_like(getattr(pushed, name), np.nan) for name in names}
    whole = {name: np.concatenate([none[name], half[name]]) for name in names}
    of_cases = {name: np.tile(getattr(pushed, name), 2) for name in ("rotor", "shaft", "kt", "strongest", "limited")}
    cases = {"case": np.array([4, 7]), "failed": np.array([True, True])}
    found = gather([replace(pushed, **whole, **of_cases, **cases)])
    assert found is not None
    assert (found.failed, found.cases) == (2, 2)
    assert found.drive.extremes["rate"].value == pytest.approx(W / 2.0, rel=3e-5)
    assert found.drive.extremes["rate"].case == 7
    assert found.drive.extremes["torque_rms"].value == pytest.approx(0.04, rel=1e-5)
    assert found.drive.extremes["power_mean"].value == pytest.approx(0.04 * W / 4.0, rel=3e-5)
    energy = 0.5 * 0.3 * (W / 2.0 / 50.0) ** 2
    assert found.load.extremes["returned_energy"].value == pytest.approx(energy, rel=3e-5)
    assert gather([replace(pushed, **none, failed=np.array([True]))]) is None


def test_a_winding_that_warms_fast_is_held_against_the_hottest_of_a_case(pushed: ShaftWork) -> None:
    torque = np.where(pushed.time < 0.5, 0.4, 0.0)[None, :]
    found = judged(replace(pushed, drive=torque), "drive", thermal_time=0.1)
    asked = {each.what: each.required for each in found.checks}
    assert asked["torque, continuous"] == pytest.approx(1.5 * 0.4 / 2.0, rel=1e-3)
    assert asked["torque, as it heats"] == pytest.approx(1.5 * 0.4 * math.sqrt(1.0 - math.exp(-5.0)), rel=1e-6)


def test_the_rotors_of_both_parts_are_on_the_shaft(pushed: ShaftWork) -> None:
    """The load of the disk's inertia less what both rotors have above the joint's own."""
    for beside, rotors in ((None, 1e-4 + 2e-4), (5e-4, 5e-4 + 2e-4)):
        found = judged(pushed, "load", beside=beside, inertia=2e-4)
        [check] = [each for each in found.checks if each.what == "torque, peak"]
        assert check.required == pytest.approx(1.5 * abs(rotors - 1e-4 - 0.3 / 2500.0) * 50.0 * 2.0 / 0.55, rel=3e-5)


@pytest.mark.release
def test_what_a_data_sheet_leaves_out_is_no_fit(met_bed: Bed, here: Path) -> None:
    bare = '[[motor]]\nname = "bare"\nsource = "a sticker"\ntorque_rated = "1 N*m"\nrate_max = "9000 rpm"\n'
    (here / "mine.toml").write_text(bare, encoding="utf-8")
    words = ("push", "--joint", "swing", "--load", "bare", "--parts", "mine.toml")
    [verdict] = sized(met_bed, *words, status=1)["parts"]
    assert (verdict["fits"], verdict["missing"]) == (None, ["torque, peak", "inertia of its rotor"])
    status, out, _ = met_bed("size", "deck.ic", *words)
    assert status == 1
    assert "load bare: not known, for its source does not give: torque, peak, inertia of its rotor\n" in out


@pytest.mark.slow
def test_of_an_archive_the_cases_that_it_has_are_sized(
    met_bed: Bed, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", "deck.ic", "heavier", "--case", "#1", "-q", "--no-picture", "-o", "one.h5"]) == 0
    status, out, err = met_bed("size", "one.h5", "--joint", "swing", "--format", "json")
    assert (status, err) == (0, "")
    [found] = json.loads(out)
    assert (found["cases"], found["load"]["figures"]["torque_peak"]["case"]) == (1, 1)
    assert [one["value"] for one in found["r"]] == pytest.approx([2.4, 2.4], rel=1e-12)


@pytest.mark.slow
def test_a_loop_that_is_not_stable_is_said_to_be_so(met_bed: Bed, here: Path) -> None:
    """At 1 kHz with a filter of 50 Hz and no delay `measured_acceleration` is stable up to r = 5.35."""
    (here / "deck.ic").write_text(ON_BED.format(mass=25 * 157.26062, law="measured_acceleration"), encoding="utf-8")
    _, out, err = met_bed("size", "deck.ic", "--load", "maxon-353297")
    assert "warning[D321]" in err
    assert "  loop              swing: r = 25, stable to 5.35 with measured_acceleration at 1000 Hz;\n" in out
    assert "the deck's bed: NOT STABLE, a lighter arm, a faster servo or another law may help\n" in out
    assert "stable with a margin of 1.5 of r at none of 10 to 500 Hz\n" in out


@pytest.mark.parametrize("margin", ["nan", "inf", "-inf"])
def test_a_margin_that_is_no_number_of_its_range_is_refused(met_bed: Bed, margin: str) -> None:
    status, out, err = met_bed("size", "deck.ic", "push", "--joint", "swing", f"--margin={margin}")
    assert (status, out) == (2, "")
    assert f"Invalid value for '--margin': {margin} is not in the range 1.0<=x<=100.0.\n" in err


def test_the_error_of_a_torque_constant_is_a_number(met_bed: Bed) -> None:
    status, out, err = met_bed("identify", "deck.ic", "--port", "none", "--kt-load-error", "nan")
    assert (status, out) == (2, "")
    assert "Invalid value for '--kt-load-error': nan is not in the range 0.0<=x<=50.0.\n" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("push",),
            "error[E333]: no joint is on a bed here\n = help: a joint that is to be on one is named: `--joint NAME`",
        ),
        (("push", "--joint", "swim"), "error[E440]: no joint `swim`\n = help: did you mean `swing`?"),
        (("push", "--joint", "swing", "--drive", "x"), "error[E442]: no motor `x` in the files of parts\n"),
        (("push", "--joint", "swing", "--parts", "x.toml"), "error[E338]: `x.toml`: No such file or directory\n"),
        (("nobody", "--joint", "swing"), "error[D164]: no run or sweep `nobody` in this deck\n"),
    ],
)
def test_what_cannot_be_sized_is_told(met_bed: Bed, words: tuple[str, ...], message: str) -> None:
    status, out, err = met_bed("size", "deck.ic", *words)
    assert (status, out) == (2, "")
    assert message in err


@pytest.mark.parametrize(
    ("run", "message"),
    [
        ("servos { swing = pushed { rate = continuous; } }", "is continuous, and on a bed a servo ticks"),
        (
            "servos { swing = pushed { friction = stribeck;  f_s = 1 N*m;  rate_s = 1 rad/s; } }",
            "has `friction = stribeck`, which no bed has",
        ),
        ("environment { stay = brake { joint = swing;  torque = 1 N*m; } }", "has friction from `stay`"),
        ("servos { swing = pushed { sensor qd = low_pass(cutoff = 50 Hz); } }", "has a sensor"),
    ],
)
def test_a_joint_that_no_bed_could_take_is_told(met_bed: Bed, here: Path, run: str, message: str) -> None:
    (here / "deck.ic").write_text(f"{PUSHED}\nrun other like push {{ {run} }}\n", encoding="utf-8")
    status, _, err = met_bed("size", "deck.ic", "other", "--joint", "swing")
    assert status == 2
    assert f"error[E440]: the servo of joint `swing` {message}" in err


@pytest.mark.release
def test_of_several_joints_on_beds_one_is_named(met_bed: Bed, here: Path) -> None:
    deck = """#include <two_link.ic>
run both like nominal { duration = 0.2 s;  substitute shoulder { }  substitute elbow { } }
"""
    (here / "deck.ic").write_text(deck, encoding="utf-8")
    status, _, err = met_bed("size", "deck.ic", "both")
    assert status == 2
    assert err.startswith(
        "error[E440]: `both` has 2 joints on beds: which?\n"
        " = help: one at a time: `--joint shoulder` or `--joint elbow`\n"
    )
    assert sized(met_bed, "both", "--joint", "elbow")["joint"] == "elbow"


@pytest.mark.slow
def test_a_joint_that_would_not_tick_with_those_on_beds_is_told(met_bed: Bed, here: Path) -> None:
    deck = """#include <two_link.ic>
run both like nominal { substitute shoulder { }  servos { elbow = gearbox { rate = 50 Hz; } } }
run bare like nominal { servos { remove elbow; } }
"""
    (here / "deck.ic").write_text(deck, encoding="utf-8")
    status, _, err = met_bed("size", "deck.ic", "both", "--joint", "elbow")
    assert status == 2
    assert (
        "error[E440]: the servo of joint `elbow` ticks at 50 Hz, and that of `shoulder`, which is on a bed, at 100 Hz\n"
        in err
    )
    status, _, err = met_bed("size", "deck.ic", "bare", "--joint", "elbow")
    assert status == 2
    assert "error[E440]: joint `elbow` of `bare` has no servo\n = help: joints that have a servo: shoulder\n" in err


@pytest.mark.slow
def test_a_drive_at_its_largest_torque_is_noted(met_bed: Bed, here: Path) -> None:
    text = PUSHED.replace("tau_max = 0.5 N*m", "tau_max = 0.03 N*m")
    (here / "deck.ic").write_text(text, encoding="utf-8")
    found = sized(met_bed, "--joint", "swing")
    assert (found["at_largest_torque"], found["drive"]["figures"]["torque_peak"]["value"]) == (1, 0.03)
    assert any(
        note.startswith("the drive motor was at the largest torque of the deck's motor in 1 of 1")
        for note in found["notes"]
    )


def test_a_run_that_fails_at_once_has_nothing_to_size(
    met_bed: Bed, here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from batch.beds import bed_size

    monkeypatch.setattr(bed_size, "gather", lambda blocks, candidates: None)
    status, _, err = met_bed("size", "deck.ic", "push", "--joint", "swing")
    assert status == 2
    assert err.startswith(
        "error[E443]: no case of `push` came to its first instant: there is nothing to size a bed by\n"
        " = help: `met run` says why its cases fail\n"
    )


@pytest.mark.slow
def test_the_range_of_filters_ends_where_the_law_is_unstable() -> None:
    """`measured_acceleration` at 1 kHz is stable up to r = 13.6, 5.35, 2.95 and 1.91 with filters of 20, 50, 100 and
    200 Hz (docs/substitution.md). With r = 2 and a margin of 1.5 that is 3: up to a little below 100 Hz."""
    at_two = compiled(ON_BED.format(mass=2 * 157.26062, law="measured_acceleration"), "bench")
    found = filter_range(at_two, "swing", [0], (2.0, 2.0), 1.5)
    assert found.f_cut == 50.0
    assert found.good == tuple(f_cut for f_cut, _ in found.tried if f_cut < 98.0)
    assert len(found.good) == 5
    # the arm of another instant counts, too: 5 times 1.5 is beyond 5.35
    assert max(filter_range(at_two, "swing", [0], (2.0, 5.0), 1.5).good) < 50.0


@pytest.mark.slow
def test_an_arm_that_grows_beyond_all_that_is_searched_of_decks_is_looked_at() -> None:
    """`velocity_tracking` has no limit here: up to 2000 for the arm at the start, and as far as the run's arm asks."""
    deck = compiled(ON_BED.format(mass=2 * 157.26062, law="velocity_tracking"), "bench")
    [[at_start]] = margins(deck, [0])
    own = filter_range(deck, "swing", [0], (2.0, 6365.0), 1.5).own
    assert (at_start.limit, at_start.searched, at_start.stable) == (None, 2000.0, True)
    assert (own.limit, own.least, own.together, own.searched, own.stable) == (None, 2.0, 6365.0, 3.0 * 6365.0, True)
    [[alone]] = margins(compiled(ON_BED.format(mass=6365 * 157.26062, law="velocity_tracking"), "bench"), [0])
    assert alone.stable and alone.together == pytest.approx(6365.0, rel=1e-6)


@pytest.mark.slow
def test_the_search_goes_as_far_as_the_margin_that_is_asked() -> None:
    deck = compiled(ON_BED.format(mass=2 * 157.26062, law="velocity_tracking"), "bench")
    found = filter_range(deck, "swing", [0], (100.0, 100.0), 50.0)
    assert found.own.limit is None and found.own.room >= 50.0
    assert max(found.good) == found.tried[-1][0]


@pytest.mark.slow
def test_what_is_printed_is_laid_out_so(met_bed: Bed) -> None:
    status, out, err = met_bed("size", "deck.ic", "heavier", "--joint", "swing", "--drive", "yaskawa-sgm7j-04a", "-v")
    assert (status, err) == (1, "")
    assert out == PRINTED


PRINTED = """heavier: a bed for joint `swing`, 3 cases of 2 s, 2,001 instants each

  drive motor            at most  order, x 1.5          where
  torque, continuous    0.04 N*m  0.06 N*m              #0
  torque, peak          0.04 N*m  0.06 N*m              #0, 0 s, at 0 rad/s
  rate                 500 rad/s  750 rad/s = 7162 rpm  #2, 2 s, at 0.04 N*m
  power, continuous         10 W  15 W                  #2
  power, peak               20 W  30 W                  #2, 2 s, at 0.04 N*m and 500 rad/s
  returned, peak             0 W  0 W                   never
  returned in a case         0 J  0 J                   never
  current, continuous        4 A  6 A                   #0
  current, peak              4 A  6 A                   #0, 0 s, at 0 rad/s
  voltage                  405 V  607.5 V               #2, 2 s, at 0.04 N*m and 500 rad/s
    at or above   driving   braking
        0 rad/s  0.04 N*m  0.04 N*m
    45.45 rad/s  0.04 N*m     0 N*m
    90.91 rad/s  0.04 N*m     0 N*m
    136.4 rad/s  0.04 N*m     0 N*m
    181.8 rad/s  0.04 N*m     0 N*m
    227.3 rad/s  0.04 N*m     0 N*m
    272.7 rad/s  0.04 N*m     0 N*m
    318.2 rad/s  0.04 N*m     0 N*m
    363.6 rad/s  0.04 N*m     0 N*m
    409.1 rad/s  0.04 N*m     0 N*m
    454.5 rad/s  0.04 N*m     0 N*m
      500 rad/s  0.04 N*m     0 N*m

  load motor              at most  order, x 1.5          where
  torque, continuous  0.02824 N*m  0.04235 N*m           #1
  torque, peak        0.02824 N*m  0.04235 N*m           #1, 0 s, at 0 rad/s
  rate                  500 rad/s  750 rad/s = 7162 rpm  #2, 2 s, at 0.015 N*m
  power, continuous           0 W  0 W                   never
  power, peak                 0 W  0 W                   never
  returned, peak          7.934 W  11.9 W                #0, 2 s, at 0.02182 N*m and 363.6 rad/s
  returned in a case      7.934 J  11.9 J                #0
    at or above      driving      braking
        0 rad/s  0.02824 N*m  0.02824 N*m
    45.45 rad/s        0 N*m  0.02824 N*m
    90.91 rad/s        0 N*m  0.02824 N*m
    136.4 rad/s        0 N*m  0.02824 N*m
    181.8 rad/s        0 N*m  0.02824 N*m
    227.3 rad/s        0 N*m  0.02824 N*m
    272.7 rad/s        0 N*m  0.02182 N*m
    318.2 rad/s        0 N*m  0.02182 N*m
    363.6 rad/s        0 N*m  0.02182 N*m
    409.1 rad/s        0 N*m    0.015 N*m
    454.5 rad/s        0 N*m    0.015 N*m
      500 rad/s        0 N*m    0.015 N*m

  arm at the shaft  6e-05 kg*m^2 (#2, 0 s) to 0.00024 kg*m^2 (#1, 0 s)
                    r = 0.6 to 2.4 of the joint's rotor, 0.0001 kg*m^2
  shaft             0.0001 kg*m^2, the joint's rotor alone: a load's adds to it
  returned          on a supply each, what is said above, into its brake resistor or capacitors;
                    on one supply at most 0 W, and 0 J in a case, less what windings take
  line              1,000 exchanges a second, for a servo of 1000 Hz:
                    at least 412500 baud, with all sensors 562500
  loop              swing: r = 2.4, stable to more than 2e+03 with velocity_tracking at 1000 Hz;
                    a bed by itself, delay = 1
  filter            50 Hz here; stable with a margin of 1.5 of r at all of 10 to 500 Hz

  drive yaskawa-sgm7j-04a: DOES NOT FIT; what binds is rate: 750 of 628.3 rad/s, 119 %
    rate                 750 rad/s  of  628.3 rad/s  119 %  #2, 2 s
    torque, continuous    0.06 N*m  of     1.27 N*m    5 %  #0
    current, continuous   0.1103 A  of        2.5 A    4 %  #0
    torque, peak          0.06 N*m  of     4.46 N*m    1 %  #0, 0 s
    current, peak         0.1103 A  of        9.3 A    1 %  #0, 0 s
    source: https://manualshive.com/ru/manual/yaskawa/sgmmv/sgmmv_product-manual_907516-55.html, section 4.2.2

  all of it is simulated: no real bed has been driven with this version
  friction, noise and converters of a bed are not in the figures: in the deck this joint is on none
  a part's rotor is on the shaft with it; a coupling and a brake are not
  a drive of other constants moves the joint otherwise: write its own into the servo, and ask again
"""
