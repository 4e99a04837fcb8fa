"""The work of a bed's two motors: closed forms, other equations for the same torques, and the engine's own metrics."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ic
from met.analysis.margin import margins
from met.analysis.shaft_work import ShaftWork, on_bed, shaft_work
from met.plan import Experiment
from met.plan.channel import recordable
from met.run import run
from tests.oracles.two_link_lagrange import Rods

BEST = (Path(__file__).parents[3] / "docs" / "best.md").read_text(encoding="utf-8")
[CRANE] = re.findall(r"<!-- crane\.ic -->\n```c\n(.*?)```", BEST, re.DOTALL)

# N^2 J_m = 0.25 kg m^2 against 0.3; back-EMF and its slope between two ticks are a millionth of the torque
PUSHED = """
servo pushed {
    model = rigid_gearbox;  ratio = 50;  kp = 1 V*s/rad;  ki = 0 V/rad;  v_max = 1000 V;  resistance = 100 ohm;
    kt = 0.01 N*m/A;  tau_max = 0.5 N*m;  j_m = 1e-4 kg*m^2;  command = torque(2 N*m);
}
arm one {
    link disk { mass = 1 kg;  inertia = [1, 1, 0.3] kg*m^2; }
    joint swing revolute { parent = base;  child = disk;  axis = z; }
}
run push {
    arm = one;  servos { swing = pushed; }  rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 10 Hz; }
    duration = 2 s;  record = [q];
}
"""


def compiled(text: str, name: str) -> Experiment:
    return ic.compile(text=text, select=[name]).experiments[0]


def work(experiment: Experiment, joint: str) -> ShaftWork:
    [block] = shaft_work(experiment, joint)
    return block


def test_a_pushed_disk_needs_what_newton_says() -> None:
    """J = N^2 J_m + I: w' = N tau/J, the load gives -I w'/N^2, and a heavier rotor of its own is to be pushed by it."""
    found = work(compiled(PUSHED, "push"), "swing")
    slope = 50.0 * 2.0 / (0.25 + 0.3)
    close = {"rtol": 1e-5, "atol": 1e-9}
    np.testing.assert_allclose(found.drive[0], 2.0 / 50.0, **close)
    np.testing.assert_allclose(found.acceleration[0], slope, **close)
    np.testing.assert_allclose(found.rate[0], slope * found.time, **close)
    np.testing.assert_allclose(found.load[0], -0.3 / 50.0**2 * slope, **close)
    np.testing.assert_allclose(found.load_on(6e-4)[0], (5e-4 - 0.3 / 50.0**2) * slope, **close)
    np.testing.assert_allclose(found.arm[0], 0.3 / 50.0**2, rtol=1e-12)
    assert found.time[-1] == 2.0
    assert (found.rotor[0], found.shaft[0], found.kt[0], found.kt_load) == (1e-4, 1e-4, 0.01, None)


def recorded(experiment: Experiment, *names: str) -> list[np.ndarray]:
    """These signals of the experiment at each instant of the dynamics."""
    structure = experiment.structure
    record = tuple(recordable(structure, [name])[name][0] for name in names)
    schedule = replace(structure.schedule, record=structure.schedule.dynamics)
    found = run(replace(experiment, structure=replace(structure, record=record, schedule=schedule)))
    return [found.signals[name] for name in names]


def measured(experiment: Experiment, joint: str, numbers: Mapping[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """The load motor's mean torque over each step in which the shaft slides on, and which steps these are: from
    recorded voltages and rates alone, by the shaft's equation J_m w' = tau_m - friction + tau_l."""
    found = recorded(experiment, f"{joint}.qd", f"{joint}.servo.voltage")
    p = numbers
    w, voltage = p["ratio"] * found[0], found[1][:, :-1]
    step = experiment.structure.schedule.step
    tau = [
        np.clip(p["kt"] / p["resistance"] * (voltage - p["kt"] * rate), -p["tau_max"], p["tau_max"])
        for rate in (w[:, :-1], w[:, 1:])
    ]
    friction = p["f_c"] * np.sign(w[:, 1:]) + p.get("f_v", 0.0) * 0.5 * (w[:, 1:] + w[:, :-1])
    load = p["j_m"] * np.diff(w) / step - 0.5 * (tau[0] + tau[1]) + friction
    return load, w[:, :-1] * w[:, 1:] > 0.0


TABLE_1 = {
    "kt": 0.061, "resistance": 2.05, "tau_max": 0.144, "j_m": 6.38e-5, "f_c": 0.0205, "f_v": 2.58e-5,
}  # fmt: skip
PANDA_2 = {
    "ratio": 100.0, "kt": 0.1, "resistance": 0.5, "tau_max": 0.87, "j_m": 0.605721456e-4, "f_c": 0.00436,
}  # fmt: skip
FINE = "rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 10 Hz; }"
ARMS = {
    "two_link": (
        f"#include <two_link.ic>\nrun fine like nominal {{ {FINE} }}\n", "shoulder", TABLE_1 | {"ratio": 1570.0}
    ),
    "panda": ("#include <panda.ic>\nrun fine like reach { duration = 5 s; }\n", "joint2", PANDA_2),
    "crane": (f"{CRANE}\nrun fine like reach {{ {FINE} }}\n", "slew", TABLE_1 | {"ratio": 200.0}),
}  # fmt: skip


@pytest.mark.release
@pytest.mark.parametrize("arm", ARMS)
def test_the_load_is_what_the_shafts_equation_leaves_over(arm: str) -> None:
    """Torque by the arm's dynamics, against that by voltage, rate and its slope: two ways that share nothing. A step's
    mean is compared with its ends' mean, which differ by as much as the torque bends or jumps within a step."""
    text, joint, numbers = ARMS[arm]
    experiment = compiled(text, "fine")
    found = work(experiment, joint)
    other, slides = measured(experiment, joint, numbers)
    mean = 0.5 * (found.load[:, 1:] + found.load[:, :-1])
    off = np.sqrt(np.mean((mean - other)[slides] ** 2) / np.mean(other[slides] ** 2))
    assert slides.mean() > 0.8
    assert off < 0.01
    assert np.abs(other[slides]).max() == pytest.approx(np.abs(mean[slides]).max(), rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("arm", ARMS)
def test_both_motors_together_give_what_the_shaft_and_friction_take(arm: str) -> None:
    """Over the run: the shaft's kinetic energy at its end, and F_c and F_v along its way."""
    text, joint, p = ARMS[arm]
    found = work(compiled(text, "fine"), joint)
    w, given = found.rate[0], (found.drive + found.load)[0] * found.rate[0]
    taken = p["f_c"] * np.abs(w) + p.get("f_v", 0.0) * w**2
    given_at_all = np.trapezoid(np.abs(found.drive[0] * w) + np.abs(found.load[0] * w), found.time)
    kinetic = 0.5 * found.shaft[0] * (w[-1] ** 2 - w[0] ** 2)
    left = np.trapezoid(given - taken, found.time) - kinetic
    assert abs(left) < 2e-4 * given_at_all


@pytest.mark.slow
def test_the_two_link_arms_load_is_its_mass_matrix_times_its_accelerations() -> None:
    """By the closed form of Lagrange's equations; the deck's arm has no velocity products."""
    experiment = compiled(ARMS["two_link"][0], "fine")
    q, qdd = (each[0] for each in recorded(experiment, "q", "qdd"))
    rods = Rods()
    l1, l2, m1, m2 = rods.length_1, rods.length_2, rods.mass_1, rods.mass_2
    c2 = np.cos(q[:, 1])
    M11 = (m1 / 3 + m2) * l1**2 + m2 * l2**2 / 3 + m2 * l1 * l2 * c2
    M12 = m2 * l2**2 / 3 + m2 * l1 * l2 * c2 / 2
    load = -(M11 * qdd[:, 0] + M12 * qdd[:, 1]) / 1570.0
    np.testing.assert_allclose(work(experiment, "shoulder").load[0], load, rtol=0, atol=1e-12)


@pytest.mark.release
@pytest.mark.parametrize("arm", ARMS)
def test_the_figures_are_those_of_the_engines_metrics(arm: str) -> None:
    text, joint, numbers = ARMS[arm]
    metrics = "".join(
        f"metric {name}_{short} = {name} {{ of = {joint}.{of}; }}"
        for name in ("rms", "peak")
        for short, of in (("drive", "servo.motor_torque"), ("load", "tau_load"), ("rate", "servo.motor_rate"))
    )
    experiment = compiled(f"{text}\nrun metered like fine {{ {metrics} }}", "metered")
    found, by_engine = work(experiment, joint), run(experiment).metrics
    loads = found.load * numbers["ratio"]
    for short, values in (("drive", found.drive), ("load", loads), ("rate", found.rate)):
        assert np.sqrt((values**2).mean()) == pytest.approx(by_engine[f"rms_{short}"][0], rel=1e-12)
        assert np.abs(values).max() == pytest.approx(by_engine[f"peak_{short}"][0], rel=1e-12)


@pytest.mark.slow
def test_a_joint_on_a_faultless_bed_asks_what_the_joint_itself_asks() -> None:
    """To the bed's own error, which settles (docs/substitution.md)."""
    text, joint, _ = ARMS["two_link"]
    bedded = "run bedded like fine { substitute shoulder { law = velocity_tracking; } }"
    own = work(compiled(text, "fine"), joint)
    bed = work(compiled(f"{text}\n{bedded}", "bedded"), joint)
    for name, most in (("drive", 2e-4), ("load", 5e-4), ("rate", 5e-4), ("arm", 1e-8)):
        one, other = (np.sqrt((getattr(each, name) ** 2).mean()) for each in (own, bed))
        assert other == pytest.approx(one, rel=most), name
    assert bed.kt_load is not None
    assert bed.kt_load[0] == 0.072


@pytest.mark.slow
def test_the_torque_on_a_bed_is_of_the_bed_s_motor_and_the_current_is_of_its_load() -> None:
    """The motor that is there, not the one of the data sheet: 7 % more torque for an ampere."""
    text = ARMS["two_link"][0] + (
        "run bedded like fine { substitute shoulder { bed = emulated(kt = 0.0653 N*m/A, kt_load = 0.1 N*m/A); } }"
    )
    experiment = compiled(text, "bedded")
    found = work(experiment, "shoulder")
    names = ("drive_voltage", "shaft_rate", "load_current")
    voltage, rate, current = recorded(experiment, *(f"shoulder.bed.{name}" for name in names))
    np.testing.assert_allclose(found.drive, 0.0653 / 2.05 * (voltage - 0.0653 * rate), rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(found.load, 0.1 * current, rtol=1e-12, atol=1e-15)


def test_a_parameter_that_a_sweep_varies_is_each_case_s_own() -> None:
    text = (
        PUSHED + "sweep ratios of push { vary pushed.ratio = [25, 50, 100];  vary pushed.j_m = [1e-4, 2e-4] kg*m^2; }"
    )
    found = work(compiled(text, "ratios"), "swing")
    ratio, rotor = np.repeat([25.0, 50.0, 100.0], 2), np.tile([1e-4, 2e-4], 3)
    np.testing.assert_array_equal(found.case, np.arange(6))
    np.testing.assert_allclose(found.rotor, rotor, rtol=1e-15)
    np.testing.assert_allclose(found.arm[:, 0], 0.3 / ratio**2, rtol=1e-12)
    slope = 2.0 / ratio / (rotor + 0.3 / ratio**2)
    np.testing.assert_allclose(found.acceleration[:, 0], slope, rtol=1e-9)


@pytest.mark.slow
def test_a_joint_that_is_put_on_a_bed_has_the_margin_of_a_deck_that_does_it() -> None:
    text, joint, _ = ARMS["panda"]
    written = "run bedded like fine { substitute joint2 { bed = emulated(delay = 1); } }"
    put = on_bed(compiled(text, "fine"), joint, delay=1)
    assert margins(put) == margins(compiled(f"{text}\n{written}", "bedded"))
    assert on_bed(put, joint, delay=0) is put
