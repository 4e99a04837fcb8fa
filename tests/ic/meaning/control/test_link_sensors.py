"""Sensors of links in decks: what is said of mistakes, what is inherited, varied and set."""

from __future__ import annotations

from pathlib import Path

import pytest

from met import run as engine
from met.plan.channel import channels
from met.plan.keys import structure_key
from tests.ic.small_decks import changed, check, experiment, messages

DECK = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
}
servo drive { model = ideal; bandwidth = 5 1/s; command = rate(0.1 rad/s); }
run hold {
    arm = swing;
    servos { hinge = drive; }
    sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q, sensors.up];
}
"""
UP = "sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; }"


def test_it_is_in_the_plan_with_its_parameters_and_its_ticks(tmp_path: Path) -> None:
    found = experiment(tmp_path, changed(DECK, ("cutoff", "rate = 50 Hz; cutoff")))
    (use,) = found.structure.sensors
    assert (use.name, use.model, use.divisor, use.words) == ("up", "accelerometer", 20, ())
    assert found.parameters["sensors.up.cutoff"].value == 20.0
    assert (found.parameters["sensors.up.noise"].unit, found.parameters["sensors.up.along.z"].unit) == ("m/s^2", "1")
    known = channels(found.structure)
    paths = ("sensors.up", "sensors.up.filtered", "sensors.up.filtered_slope")
    assert [known[path].unit for path in paths] == ["m/s^2", "m/s^2", "m/s^3"]
    assert [known[path].divisor for path in paths] == [20, 1, 1]


def test_a_run_without_sensors_keeps_its_key(tmp_path: Path) -> None:
    bare = changed(
        DECK,
        ("    sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; }\n", ""),
        (", sensors.up]", "]"),
    )
    # as it was before there were sensors of links
    assert structure_key(experiment(tmp_path, bare).structure) == "b9e50f89a5bb9478"


def test_a_run_like_another_changes_adds_and_removes_sensors(tmp_path: Path) -> None:
    more = """\
run other like hold {
    up { cutoff = 30 Hz; }
    sensor spin = gyroscope { link = base; along = [1, 0, 0]; filter = butterworth; cutoff = 3 Hz; }
    record += [sensors.spin];
}
run bare like hold { remove up; record = [q]; }
"""
    other = experiment(tmp_path, DECK, more, select=["other"])
    assert other.parameters["sensors.up.cutoff"].value == 30.0
    assert other.structure.sensors[1].words == (("filter", "butterworth"),)
    assert experiment(tmp_path, DECK, more, select=["bare"]).structure.sensors == ()


def test_sensors_stands_for_what_all_of_them_read(tmp_path: Path) -> None:
    deck = changed(
        DECK,
        ("    rates", "    sensor spin = gyroscope { link = bar; along = [0, 0, 1]; }\n    rates"),
        ("sensors.up]", "sensors]; tolerances { sensors.spin = 1 rad/s; }"),
    )
    assert [each.name for each in experiment(tmp_path, deck).structure.record] == ["q", "sensors.up", "sensors.spin"]


@pytest.mark.slow
@pytest.mark.parametrize(("path", "values"), [
    ("sensors.up.noise", "[0, 0.1] m/s^2"), ("sensors.up.along.x", "[0, 1]"), ("sensors.up.at.x", "[0, 1] m"),
    ("sensors.up.bias", "[0, 1] m/s^2"), ("sensors.up.cutoff", "[10, 20] Hz"), ("sensors.up.delay", "[0, 2]"),
])  # fmt: skip
def test_its_parameters_can_be_varied(path: str, values: str, tmp_path: Path) -> None:
    deck = changed(DECK, ("along = [0, 0, 1]", "at = [1, 0, 0] m; along = [1, 1, 1]"))
    compiled = check(tmp_path, deck, f"sweep cases of hold {{ vary {path} = {values}; }}\n", select=["cases"])
    assert compiled.plan is not None and not compiled.diagnostics, messages(compiled)
    assert sum(each.cases.count for each in compiled.plan.experiments) == 2


@pytest.mark.parametrize(("path", "values"), [
    ("sensors.up.link", "[bar, base]"), ("sensors.up.rate", "[100, 200] Hz"),
    ("sensors.spin.filter", "[none, butterworth]"),
])  # fmt: skip
def test_what_decides_its_program_makes_a_group_for_each(path: str, values: str, tmp_path: Path) -> None:
    spin = "sensor spin = gyroscope { link = bar; along = [0, 0, 1]; filter = butterworth; cutoff = 9 Hz; }"
    deck = changed(DECK, ("    rates", f"    {spin}\n    rates"))
    compiled = check(tmp_path, deck, f"sweep cases of hold {{ vary {path} = {values}; }}\n", select=["cases"])
    assert compiled.plan is not None and not compiled.diagnostics, messages(compiled)
    one, other = compiled.plan.experiments
    if path.endswith("rate"):
        assert [each.structure.sensors[0].divisor for each in (one, other)] == [10, 5]
    else:
        assert one.parameters[path].value != other.parameters[path].value


def test_a_metric_and_a_requirement_watch_a_reading(tmp_path: Path) -> None:
    watched = "metric most = max { of = sensors.up; }  require most < 1 m/s^2;  record"
    run = engine.run(experiment(tmp_path, changed(DECK, ("record = [", f"{watched} = ["))))
    assert run.metrics["most"].tolist() == [0.0] and [each.tolist() for each in run.met.values()] == [[True]]


@pytest.mark.parametrize(
    ("sweep", "said"),
    [
        ("sensors.up = [1, 2]", "it is a sensor: vary a parameter of it, `sensors.up.PARAMETER`"),
    ],
)
def test_what_cannot_vary_is_told(sweep: str, said: str, tmp_path: Path) -> None:
    (found,) = check(tmp_path, DECK, f"sweep cases of hold {{ vary {sweep}; }}\n", select=["cases"]).diagnostics
    assert (found.code, found.help) == ("D122", (said,))


@pytest.mark.slow
@pytest.mark.parametrize(("text", "instead", "expected"), [
    ("link = bar", "link = barr", """\
error[D159]: no link `barr` in arm `swing`
 --> deck.ic:9:40
  |
9 |     sensor up = accelerometer { link = barr; along = [0, 0, 1]; cutoff = 20 Hz; }
  |                                        ^^^^
  = help: did you mean `bar`?
  = help: links: bar
  = help: or `base`

1 error
"""),
    (" cutoff = 20 Hz;", "", """\
error[D075]: sensor `up` has no `cutoff`
 --> deck.ic:9:5
  |
9 |     sensor up = accelerometer { link = bar; along = [0, 0, 1]; }
  |     ^^^^^^^^^
  = help: write `cutoff = ... Hz;` (cut-off frequency of the filter)

1 error
"""),
    ("[0, 0, 1]", "[0, 0, 0]", """\
error[D240]: `along` of sensor `up` has no direction
 --> deck.ic:9:53
  |
9 |     sensor up = accelerometer { link = bar; along = [0, 0, 0]; cutoff = 20 Hz; }
  |                                                     ^^^^^^^^^
  = help: write numbers of ordinary size, not all of them zero

1 error
"""),
    (UP, f"{UP} sensor up = gyroscope {{ }}", """\
error[D040]: sensor `up` is written twice
 --> deck.ic:9:82
  |
9 |     sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; } sensor up = gyroscope { }
  |                                                                                  ^^^^^^^^^ again
 ::: deck.ic:9:5  first
  = help: remove one of the two
  = help: or give one of the two another name

1 error
"""),
    (UP, "sensor up = tachometer { }", """\
error[D281]: `tachometer` is a sensor of a joint, and this is a run
 --> deck.ic:9:17
  |
9 |     sensor up = tachometer { }
  |                 ^^^^^^^^^^
  = help: write `sensor QUANTITY = tachometer { ... }` in a servo, such as of `qd`
  = help: sensors of links: accelerometer, gyroscope

1 error
"""),
    (UP, "sensor up { link = bar; }", """\
error[D280]: sensor `up` has no model
 --> deck.ic:9:5
  |
9 |     sensor up { link = bar; }
  |     ^^^^^^^^^
  = help: write `sensor NAME = MODEL { link = LINK; ... }`
  = help: sensors of links: accelerometer, gyroscope

1 error
"""),
    ("sensor up =", "sensor up down =", """\
error[D280]: `down` after the name of a sensor
 --> deck.ic:9:15
  |
9 |     sensor up down = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; }
  |               ^^^^
  = help: write `sensor NAME = MODEL { link = LINK; ... }`
  = help: sensors of links: accelerometer, gyroscope

1 error
"""),
    ("command", "sensor qd = gyroscope { link = bar; } command", """\
error[D281]: `gyroscope` is a sensor of a link, and this is a servo
 --> deck.ic:5:61
  |
5 | servo drive { model = ideal; bandwidth = 5 1/s; sensor qd = gyroscope { link = bar; } command = rate(0.1 rad/s); }
  |                                                             ^^^^^^^^^
  = help: write `sensor NAME = gyroscope { link = LINK; ... }` in a run

1 error
"""),
    ("cutoff", "rate = 2 kHz; cutoff", """\
error[D282]: sensor `up` reads at 2000 Hz, between the steps of the dynamics
 --> deck.ic:9:71
  |
9 |     sensor up = accelerometer { link = bar; along = [0, 0, 1]; rate = 2 kHz; cutoff = 20 Hz; }
  |                                                                       ^^^^^
 ::: deck.ic:10:24  1000 Hz
  = help: give the sensor a `rate` that divides 1000 Hz, or quicken the dynamics

1 error
"""),
    ("dynamics = 1 kHz", "dynamics = 500 Hz", """\
error[D282]: sensor `up` reads at 1000 Hz, between the steps of the dynamics
  --> deck.ic:10:41
   |
10 |     rates { dynamics = 500 Hz; servos = 1 kHz; record = 100 Hz; }
   |                                         ^^^^^
  ::: deck.ic:10:24  500 Hz
   = help: give the sensor a `rate` that divides 500 Hz, or quicken the dynamics

1 error
"""),
    ("servos = 1 kHz", "servos = continuous", """\
error[D282]: sensor `up` has no rate, and the servos are continuous
 --> deck.ic:9:5
  |
9 |     sensor up = accelerometer { link = bar; along = [0, 0, 1]; cutoff = 20 Hz; }
  |     ^^^^^^^^^
  = help: write `rate = 100 Hz;` in the sensor

1 error
"""),
    ("20 Hz", "1 kHz", """\
error[D104]: sensor `up` is unstable with modified_euler at this rate of the dynamics
  --> deck.ic:10:24
   |
10 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h * lambda = 6.28; the slowest rate that fits is 4000 Hz
   = help: h * lambda must stay below 2; lambda is the rate constant of the sensor's filter, 2 pi cutoff

1 error
"""),
    ("20 Hz", "100 Hz", """\
warning[D105]: sensor `up` is fast for the dynamics' step: h * lambda = 0.628
  --> deck.ic:10:24
   |
10 |     rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                        ^^^^^ h = 0.001 s
   = help: stable below 2 with modified_euler, true to the motion below 0.5: the slowest rate that fits is 2000 Hz

1 warning
"""),
    ("sensors.up]", "sensors.pu]", """\
error[D125]: no channel `sensors.pu`
  --> deck.ic:12:18
   |
12 |     record = [q, sensors.pu];
   |                  ^^^^^^^^^^
   = help: did you mean `sensors.up`?
   = help: sensors of links: sensors.up, sensors.up.filtered, sensors.up.filtered_slope

1 error
"""),
    ("joint hinge", "joint sensors", """\
error[D166]: `sensors` begins paths of its own, so no joint may be called so
 --> deck.ic:3:5
  |
3 |     joint sensors revolute { parent = base; child = bar; axis = z; }
  |     ^^^^^^^^^^^^^^^^^^^^^^
  = help: give the joint another name

error[D144]: no joint `hinge` in arm `swing`
 --> deck.ic:8:14
  |
8 |     servos { hinge = drive; }
  |              ^^^^^
  = help: joints: none

2 errors
"""),
    ("rates {", "environment { sensor a = gyroscope { } } rates {", """\
error[D157]: no `sensor` in an environment
  --> deck.ic:10:19
   |
10 |     environment { sensor a = gyroscope { } } rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
   |                   ^^^^^^^^
   = help: write `NAME = MODEL { ... }`

1 error
"""),
])  # fmt: skip
def test_a_mistake_is_told_with_its_place_and_a_remedy(text: str, instead: str, expected: str, tmp_path: Path) -> None:
    assert messages(check(tmp_path, changed(DECK, (text, instead)))) == expected
