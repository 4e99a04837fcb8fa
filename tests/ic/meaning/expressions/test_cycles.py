"""Numbers that may mean something else, each told with what to write for every thing that may be meant: a hertz where
radians or decays count, and the reverse; bare numbers of degrees; bare numbers of per cent."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from met import models
from tests.ic.small_decks import check, codes, messages

DECK = """\
arm swing {
    link bar  { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    link tool { mass = 1 kg; shape = sphere(radius = 1 cm); }
    joint hinge revolute  { parent = base; child = bar; axis = z; }
    joint lift  prismatic { parent = bar;  child = tool; axis = z; at = [1 m, 0 m, 0 m]; }
}
servo still { model = ideal; bandwidth = 5 s^-1; command = position(sine(amplitude = 1 rad, frequency = 1 Hz)); }
servo drive {
    model = rigid_gearbox; ratio = 10 cycle/m; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm;
    kt = 0.05 N*m/A; tau_max = 1 N*m; j_m = 1e-2 kg*m^2; command = rate(0.1 m/s);
}
let quick = 5 s^-1;
run hold {
    arm = swing;
    servos { hinge = still; lift = drive; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
    metric most = max { of = hinge.q; }
}
"""


def deck(*changes: tuple[str, str]) -> str:
    text = DECK
    for before, after in changes:
        assert text.count(before) == 1, before
        text = text.replace(before, after)
    return text


def found(folder: Path, *changes: tuple[str, str], **options: object) -> tuple[list[str], list[tuple[str, ...]]]:
    """Codes of what is told of the deck, and the help of each."""
    compiled = check(folder, deck(*changes), select="all", **options)  # type: ignore[arg-type]
    assert compiled.plan is not None, messages(compiled)
    return [each.code for each in compiled.diagnostics], [each.help for each in compiled.diagnostics]


def test_the_deck_that_the_next_tests_change_is_plain(tmp_path: Path) -> None:
    assert found(tmp_path)[0] == []


HZ = ("bandwidth = 5 s^-1", "bandwidth = 5 Hz")


def test_hertz_for_a_rate_constant(tmp_path: Path) -> None:
    assert (
        messages(check(tmp_path, deck(HZ)))
        == """\
warning[D305]: `bandwidth` of servo `still` is in 1/s, and 5 Hz is taken as 5 1/s
 --> deck.ic:7:42
  |
7 | servo still { model = ideal; bandwidth = 5 Hz; command = position(sine(amplitude = 1 rad, frequency = 1 Hz)); }
  |                                          ^^^^
  = help: if that is meant, write `5 1/s`
  = help: if cycles a second are meant, write `(2*pi*5) 1/s`

1 warning
"""
    )


DOUBTS = {
    "hertz for 1/s": (("bandwidth = 5 s^-1", "bandwidth = {}"), "5 Hz", "still.bandwidth", (5.0, 10 * math.pi)),
    "kilohertz for 1/s": (("bandwidth = 5 s^-1", "bandwidth = {}"), "0.05 kHz", "", (50.0, 100 * math.pi)),
    "1/s for hertz": (("frequency = 1 Hz", "frequency = {}"), "10 1/s", "", (10.0, 5 / math.pi)),
    "volts a hertz": (("kp = 0.1 V*s/rad", "kp = {}"), "0.05 V/Hz", "", (0.05, 0.025 / math.pi)),
    "1/mm for an angle over a length": (("ratio = 10 cycle/m", "ratio = {}"), "0.1 1/mm", "", (100.0, 200 * math.pi)),
    "a quotient": (("ratio = 10 cycle/m", "ratio = {}"), "1/(10 mm)", "", (100.0, 200 * math.pi)),
    "an integral gain of a corner in Hz": (("ki = 1 V/rad", "ki = {}"), "0.1 V*s/rad * 2 Hz", "", (0.2,)),
}
PATHS = {
    "ki": "lift.servo.ki",
    "bandwidth": "hinge.servo.bandwidth",
    "frequency": "hinge.servo.command.frequency",
    "kp": "lift.servo.kp",
    "ratio": "lift.servo.ratio",
}


@pytest.mark.slow
@pytest.mark.parametrize("name", DOUBTS)
def test_each_remedy_followed_as_it_is_written_is_what_it_says_and_is_plain(tmp_path: Path, name: str) -> None:
    (before, after), written, _, meant = DOUBTS[name]
    seen, helps = found(tmp_path, (before, after.format(written)))
    assert seen == ["D305"]
    remedies = [re.findall("`(.*)`", each)[0] for each in helps[0]]
    for remedy, number in zip(remedies, meant, strict=False):
        compiled = check(tmp_path, deck((before, after.format(remedy))))
        assert codes(tmp_path, deck((before, after.format(remedy)))) == [], remedy
        assert compiled.plan is not None
        value = compiled.plan.experiments[0].parameters[PATHS[before.partition(" ")[0]]].value
        assert value == pytest.approx(number, rel=1e-11), remedy  # the help shows 12 digits


PLAIN = [
    ("bandwidth = 5 s^-1", "bandwidth = 1/(0.2 s)"), ("bandwidth = 5 s^-1", "bandwidth = 2*pi*5 Hz"),
    ("frequency = 1 Hz", "frequency = 1/(2 s)"), ("kp = 0.1 V*s/rad", "kp = 0.1 N*m/A"),
    ("kp = 0.1 V*s/rad", "kp = 0.1 V/rpm"), ("kp = 0.1 V*s/rad", "kp = 0.1 V*s"), ("ki = 1 V/rad", "ki = 1 V"),
    ("kt = 0.05 N*m/A", "kt = 0.05 V*s/rad"), ("kt = 0.05 N*m/A", "kt = 0.01 V/rpm"),
    ("dynamics = 1 kHz", "dynamics = 1/(1 ms)"), ("ratio = 10 cycle/m", "ratio = 1 cycle / 5 mm"),
    ("ratio = 10 cycle/m", "ratio = 100 rad/m"), ("dynamics = 1 kHz", "dynamics = 1000 1/s"),
    ("bandwidth = 5 s^-1", "bandwidth = 6.2832 * 5 Hz"), ("bandwidth = 5 s^-1", "bandwidth = 2 * 3.14 * 5 Hz"),
    ("bandwidth = 5 s^-1", "bandwidth = 6.28 * quick"), ("bandwidth = 5 s^-1", "bandwidth = quick"),
    ("bandwidth = 5 s^-1", "bandwidth = 0.02/(4 ms)"), ("ki = 1 V/rad", "ki = 0.1 V*s/rad * 2*pi*1.5 Hz"),
    ("ratio = 10 cycle/m", "ratio = 2*pi/(5 mm)"), ("ratio = 10 cycle/m", "ratio = 10 rad/(20 mm)"),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("change", PLAIN, ids=lambda change: change[1])
def test_what_is_plain_is_not_told(tmp_path: Path, change: tuple[str, str]) -> None:
    assert "D305" not in found(tmp_path, change)[0]


@pytest.mark.parametrize("written", [
    "rate(0.1 Hz * 1 cycle)", "rate(15 deg * 2 Hz)", "rate(sine(amplitude = 2*pi*beat*20 deg, frequency = beat))",
    "acceleration(30 deg/s * beat)", "acceleration(3 deg * (2*pi*beat)^2)", "acceleration(3 deg * beat^2)",
])  # fmt: skip
def test_an_angle_times_a_frequency_is_plain(tmp_path: Path, written: str) -> None:
    command = ("command = position(sine(amplitude = 1 rad, frequency = 1 Hz))", f"command = {written}")
    assert "D305" not in codes(tmp_path, "let beat = 2 Hz;\n" + deck(command))


@pytest.mark.parametrize("written", ["3.15", "6.2", "3.143", "6.29", "31.4"])
def test_what_is_not_pi_makes_no_cycles_of_hertz(tmp_path: Path, written: str) -> None:
    assert found(tmp_path, ("bandwidth = 5 s^-1", f"bandwidth = {written} * 5 Hz"))[0] == ["D305"]


def test_damping_of_stiffness_and_inertia_is_plain(tmp_path: Path) -> None:
    text = deck(
        ("arm swing", "let k = 100 N*m/rad;\nlet j = 0.64 kg*m^2;\nlet w0 = 20 rad/s;\narm swing"),
        (
            "model = ideal; bandwidth = 5 s^-1; command = position(sine(amplitude = 1 rad, frequency = 1 Hz))",
            "model = passive; stiffness = j*w0^2; damping = 2*sqrt(k*j)",
        ),
    )
    compiled = check(tmp_path, text)
    assert compiled.plan is not None, messages(compiled)
    assert not [each.code for each in compiled.diagnostics if each.code == "D305"]
    assert compiled.plan.experiments[0].parameters["hinge.servo.damping"].value == pytest.approx(16.0, rel=1e-15)


@pytest.mark.parametrize("written", ["quick", "2 * quick", "quick / 2", "-(-quick)", "min(quick, 9 Hz)"])
def test_hertz_that_come_by_a_let_are_told_where_they_are_used(tmp_path: Path, written: str) -> None:
    text = deck(("bandwidth = 5 s^-1", f"bandwidth = {written}"), ("let quick = 5 s^-1", "let quick = 5 Hz"))
    assert codes(tmp_path, text) == ["D305"]


@pytest.mark.slow
@pytest.mark.parametrize("axis", [
    "vary still.bandwidth = [5, 6] Hz;", "vary still.bandwidth = linspace(5, 6, 3) Hz;",
    "vary still.bandwidth = (5 .. 6 by 1) Hz;", "zip { still.bandwidth = [5, 6] Hz; }",
    "sample random(3) { still.bandwidth = uniform(5, 6) Hz; }", 'from "cases.csv";',
    "vary still.bandwidth = [5, 6] 1/s; exclude when still.bandwidth > 5.5 Hz;",
])  # fmt: skip
def test_hertz_of_a_sweep_are_told_once(tmp_path: Path, axis: str) -> None:
    (tmp_path / "cases.csv").write_text("still.bandwidth [Hz]\n5\n6\n", encoding="utf-8")
    assert codes(tmp_path, deck() + f"sweep bands of hold {{ {axis} }}\n", select="all") == ["D305"]


def test_hertz_set_on_the_command_line_are_told(tmp_path: Path) -> None:
    assert found(tmp_path, set=("still.bandwidth=6 Hz",))[0] == ["D305"]


@pytest.mark.slow
@pytest.mark.parametrize("written", ["sin(90)", "cos(-45)", "sin(ninety)", "cos(2 * ninety)", "-sin(90) + 1"])
def test_a_sine_of_more_than_a_turn_of_bare_radians(tmp_path: Path, written: str) -> None:
    text = f"let ninety = 90;\nlet it = {written};\n" + deck()
    compiled = check(tmp_path, text)
    assert [each.code for each in compiled.diagnostics] == ["D306"]
    for help in compiled.diagnostics[0].help:
        call = re.search(r"(?:sin|cos)\([^()]*\)", written)
        assert call is not None
        instead = re.findall("`(.*)`", help)[0]
        assert codes(tmp_path, text.replace(call[0], instead)) == [], instead


@pytest.mark.slow
@pytest.mark.parametrize("written", [
    "sin(90 deg)", "sin(6)", "cos(2*pi*9)", "sin(100 rad)", "(sin(0.5) * 90) deg", "sqrt(90)", "sin(3 1/s * 5 s)",
    "cos(7 m / 90 cm)", "sin(3 rad/s * 5 s)", "cos(4 * 3.1416)",
])  # fmt: skip
def test_a_sine_that_is_plain(tmp_path: Path, written: str) -> None:
    assert codes(tmp_path, f"let it = {written};\n" + deck()) == []


def test_a_sine_inside_blocks_of_a_run_and_a_call(tmp_path: Path) -> None:
    change = ("amplitude = 1 rad", "amplitude = (sin(90)) rad")
    assert found(tmp_path, change)[0] == ["D306"]


SHARES = "    metric over = overshoot { of = hinge.q; target = 1 rad; }\n"
LAST = ("    metric most = max { of = hinge.q; }\n", SHARES + "    require over < {};\n")


@pytest.mark.parametrize(("limit", "seen"), [
    ("2", ["D307"]), ("150", ["D307"]), ("2 %", []), ("0.02", []), ("1", []), ("200 %", []), ("(4/2)", ["D307"]),
])  # fmt: skip
def test_a_share_above_1_without_its_per_cent(tmp_path: Path, limit: str, seen: list[str]) -> None:
    assert found(tmp_path, (LAST[0], LAST[1].replace("{}", limit)))[0] == seen


def test_the_band_of_a_settling_time_is_a_share_too(tmp_path: Path) -> None:
    metric = "    metric done = settling_time { of = hinge.q; target = 1 rad; band = 2; }\n"
    seen, helps = found(tmp_path, (LAST[0], metric))
    assert seen == ["D307"]
    assert helps == [("if per cent are meant, write `2 %`", "if that is meant, write `200 %`")]


@pytest.mark.slow
@pytest.mark.parametrize("axis", [
    "vary metrics.done.band = [1, 2, 5];", "sample random(3) { metrics.done.band = uniform(1.5, 5); }",
    "zip { metrics.done.band = linspace(1, 5, 3); }",
])  # fmt: skip
def test_a_share_that_varies(tmp_path: Path, axis: str) -> None:
    text = deck((LAST[0], "    metric done = settling_time { of = hinge.q; target = 1 rad; band = 2 %; }\n"))
    assert codes(tmp_path, text + f"sweep bands of hold {{ {axis} }}\n", select="all") == ["D307"]
    assert codes(tmp_path, text + f"sweep bands of hold {{ {axis.replace(';', ' %;')} }}\n", select="all") == []


@pytest.mark.parametrize(("name", "seen"), [("rel", ["D307"]), ("over", ["D307"]), ("most", [])])
def test_a_tolerance_that_is_a_share(tmp_path: Path, name: str, seen: list[str]) -> None:
    size = "5 deg" if name == "most" else "5"
    change = (LAST[0], LAST[0] + SHARES + f"    tolerances {{ {name} = {size}; }}\n")
    assert found(tmp_path, change)[0] == seen
    assert found(tmp_path, (change[0], change[1].replace("5;", "5 %;")))[0] == []


def test_a_metric_that_counts_is_no_share(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = models.find_own("metric") | {"overshoot": replace(models.find("metric", "overshoot"), share=False)}
    before = models.find_own
    monkeypatch.setattr(models, "find_own", lambda kind: own if kind == "metric" else before(kind))
    assert found(tmp_path, (LAST[0], LAST[1].replace("{}", "5")))[0] == []


def test_a_mistake_elsewhere_does_not_hide_them(tmp_path: Path) -> None:
    text = deck(HZ, ("duration = 1 s;", "durations = 1 s;"), ("arm swing", "let a = sin(90);\narm swing"))
    compiled = check(tmp_path, text, select="all")
    assert [each.code for each in compiled.diagnostics] == ["D306", "D305", "D109"]
