"""A bed whose drive is told a rate and closes the rate loop by itself, without saying its torque: closed forms of its
loop, and runs beside those in software of the same loop, of other gains, and on other beds."""

from __future__ import annotations

import math

import numpy as np
import pytest

from hw.beds import emulated
from hw.beds.emulated import EmulatedBed
from met import backends
from met import run as engine
from met.analysis.linear.answers import LinearQuestion
from met.analysis.margin import margins
from met.analysis.shaft_work import shaft_work
from met.plan import Experiment
from met.plant import Plant
from met.program import build
from met.servos.motor import Motor, RateLoop
from met.substitution.drive import loop_torque, wound
from met.trace.recorder import record
from tests.substitution import test_torque_drive as torque_drive
from tests.substitution.hybrid import compiled
from tests.substitution.test_torque_drive import SLOW, bench, ran, shaft

KT, R, J, TAU_MAX, V_MAX = 0.061, 2.05, 6.38e-5, 0.144, 20.0
KP, KI = 0.020, 0.125
"""The paper's table 1."""

PLAIN = """
    #include <two_link.ic>
    run fine like nominal {
        rates { base = 4 kHz;  dynamics = 4 kHz;  servos = 4 kHz;  record = 100 Hz; }
        duration = 2 s;  remove settle;  record = [q, qd, tau];  MORE
    }
"""
"""The run in software, its servos as fast as a drive's own loop."""


def software(more: str = "") -> np.ndarray:
    rates: np.ndarray = engine.run(compiled(PLAIN.replace("MORE", more), "fine")).signals["qd"][0, :, 0]
    return rates


def off(one: np.ndarray, other: np.ndarray) -> float:
    """Rates apart, rms, as a share of the rate commanded."""
    return float(np.sqrt(np.mean((one - other) ** 2)) / SLOW)


def rates(bed: str, law: str = "velocity_tracking", more: str = "") -> np.ndarray:
    found: np.ndarray = ran(bench(bed, law, more)).signals["qd"][0, :, 0]
    return found


@pytest.mark.release
def test_with_the_deck_s_own_loop_it_is_the_run_in_software() -> None:
    plain = software()
    assert off(rates("rate_drive()"), plain) < 1e-4
    assert off(rates("rate_drive(delay = 1)"), plain) < 8e-4  # what is told comes a tick later
    assert off(rates("emulated(delay = 1)"), plain) > 1e-3  # whose servo sees the shaft through a filter


@pytest.mark.release
@pytest.mark.parametrize(
    ("kp", "ki", "drift", "most"), [(1.2, 1.0, "1e-5", 0.15), (1.0, 1.28, "1e-5", 0.06), (5.0, 8.0, "1e-3", 0.05)]
)
def test_it_follows_the_loop_that_the_drive_has_and_not_the_deck_s(
    kp: float, ki: float, drift: str, most: float
) -> None:
    """The drive's gains are not what the deck believes, and nothing says its torque: it is the observer's d. most: how
    far off, as a share of what the drive's gains change."""
    drive = f"kp = {kp * KP!r} V*s/rad, ki = {ki * KI!r} V/rad"
    found = rates(f"rate_drive(delay = 1, {drive})", f"velocity_tracking(drift = {drift} N^2*m^2/s)")
    plain, there = software(), software(f"servos {{ shoulder {{ {drive.replace(',', ';')}; }} }}")
    assert off(found, there) < most * off(plain, there)
    assert off(found, plain) > 0.9 * off(plain, there)


@pytest.mark.slow
def test_the_law_that_knows_no_torque_needs_none() -> None:
    assert off(rates("rate_drive(delay = 1)", "measured_acceleration"), software()) < 4e-3


@pytest.mark.slow
def test_a_position_loop_of_the_servo_s_tells_the_rate() -> None:
    position = """servos { shoulder { command = position(sine(amplitude = 0.02 rad, frequency = 0.25 Hz));
                                      k_position = 4 1/s; } }"""
    experiment = compiled(bench("rate_drive(delay = 1)", more="").replace("run bench like plain {", f"""
        run bench like plain {{ {position} record += [shoulder.bed.drive_rate];"""), "bench")  # fmt: skip
    found = engine.run(experiment)
    assert not found.status.any()
    told, q = found.signals["shoulder.bed.drive_rate"][0], found.signals["q"][0, :, 0]
    a, w = 0.02, 2.0 * math.pi * 0.25
    t = found.time
    wanted = 1570.0 * (a * w * np.cos(w * t) + 4.0 * (a * np.sin(w * t) - q))
    np.testing.assert_allclose(told[10:], wanted[10:], atol=0.25)  # a tick before: 1 ms of it
    there = engine.run(compiled(PLAIN.replace("MORE", position), "fine")).signals["q"][0, :, 0]
    assert np.abs(q - there).max() < 2e-3 * a * w  # it is held for a tick, and comes a tick late


@pytest.mark.slow
def test_the_loop_of_a_shaft_without_friction_does_as_its_difference_equation_says() -> None:
    plant = shaft("rate_drive(f_c = 0 N*m, f_v = 0 N*m*s/rad)")
    plant.start(3.0)
    w, integral, h = 3.0, 0.0, 2.5e-4
    fading = math.exp(-KT * KT / R / J * h)
    for tick in range(400):
        plant.tick(40.0, 0.02)
        for _ in range(4):
            error = 40.0 - w
            last = (KP * error + KI * integral) / KT + 0.072 * 0.02 * R / KT**2
            integral += h * error
            w = last + (w - last) * fading
        assert plant.shaft_rate == pytest.approx(w, rel=1e-9), tick


def test_its_loop_brings_a_shaft_with_friction_to_the_rate_that_is_told() -> None:
    plant = shaft("rate_drive(kp = 0.2 V*s/rad, ki = 5 V/rad)")
    plant.start(0.0)
    for _ in range(3000):
        plant.tick(25.0, -0.05)
    assert plant.shaft_rate == pytest.approx(25.0, rel=1e-9)


MOTOR = Motor(ratio=1570.0, kt=KT, resistance=R, tau_max=TAU_MAX, inertia=J, f_c=0.0205, f_v=2.58e-5)


@pytest.mark.parametrize(
    ("command", "w", "integral", "brakes"),
    [
        (50.0, 20.0, 10.0, KT / R * (KT + KP)),
        (2000.0, 300.0, 0.0, KT * KT / R),  # at the voltage's limit
        (300.0, -100.0, 0.0, 0.0),  # at the torque's
    ],
)
def test_what_a_loop_s_torque_falls_by_is_its_slope(command: float, w: float, integral: float, brakes: float) -> None:
    def at(rate: float, told: float) -> float:
        # the integral goes on over half of no time
        return float(loop_torque(MOTOR, RateLoop(KP, KI, V_MAX), integral, told, rate, 0.0).torque)

    found = loop_torque(MOTOR, RateLoop(KP, KI, V_MAX), integral, command, w, 0.0)
    assert found.brakes == pytest.approx(brakes, rel=1e-12)
    assert (at(w - 1e-3, command) - at(w + 1e-3, command)) / 2e-3 == pytest.approx(brakes, abs=1e-10)
    assert abs(found.torque) <= TAU_MAX


def test_an_integral_is_held_while_its_voltage_is_limited() -> None:
    loop = RateLoop(KP, KI, V_MAX)
    assert wound(loop, 0.0, 30.0, 0.5) == 15.0
    assert wound(loop, 200.0, 1.0, 0.5) == 200.0  # 25 V are asked
    assert wound(loop, 200.0, -1.0, 0.5) == 199.5


@pytest.mark.slow
def test_on_a_scaled_bed_it_is_the_same_run() -> None:
    full = rates("rate_drive(delay = 1)")
    small = f"rate_drive(delay = 1, kt_load = {0.072 * 2 / 10!r} N*m/A)"
    lab = rates(small, more="scale { torque = 25;  rate = 2;  voltage = 10; }")
    assert off(full, lab) < 1e-11


def turner(law: str, loads: list[float]) -> Experiment:
    return torque_drive.turner(law, loads, "rate_drive(delay = 1, kp = 0.03 V*s/rad)")


@pytest.mark.release
@pytest.mark.parametrize("law", ["measured_acceleration", "velocity_tracking"])
def test_a_pole_of_the_whole_program_leaves_the_unit_circle_at_the_limit_of_its_margin(law: str) -> None:
    rotor = 1570.0**2 * J
    ((found,),) = margins(turner(law, [rotor]))
    sides = [(False, 100.0)] if found.limit is None else [(False, 0.999 * found.limit), (True, 1.001 * found.limit)]
    assert (found.limit is None) == (law == "velocity_tracking")
    question = LinearQuestion(turner(law, [r * rotor for _, r in sides]))
    for case, (grows, r) in enumerate(sides):
        largest = max(abs(pole.z) for pole in question.of(case).poles)
        assert (largest > 1.0 + 1e-7) == grows, (r, largest)


@pytest.mark.slow
def test_at_a_port_it_is_told_rates_and_makes_the_same_bits() -> None:
    deck = bench("rate_drive(faults = typical, delay = 1)").replace("duration = 2 s", "duration = 0.5 s")
    experiment = compiled(deck, "bench")
    values = {
        path.removeprefix("shoulder.bed."): each.value
        for path, each in experiment.parameters.items()
        if path.startswith("shoulder.bed.")
    }
    plant = Plant(experiment, "shoulder")
    limits = emulated.limits(values, plant.period, voltage=1000.0)  # type: ignore[arg-type]
    bed = EmulatedBed(plant, emulated.scales(values, "rate"), limits, drive="rate")  # type: ignore[arg-type]
    assert bed.connect().drive == "rate"
    program = build(experiment, wire=True, late=0)
    assert {"wire:shoulder.rate", "wire:shoulder.current"} <= set(program.outputs)
    block = backends.load(record(program), 4).block(np.zeros((1, len(program.inputs))))
    told = [program.outputs.index(f"wire:shoulder.{name}") for name in ("rate", "current")]
    sample, commands = bed.preset(), (0.0, 0.0)
    bed.arm()
    ticks = experiment.structure.schedule.ticks
    for tick in range(ticks + 1):
        if tick:
            answer = bed.exchange(*commands)
            assert answer is not None
            sample = answer
        block.inputs[program.inputs.index("wire:shoulder.rate"), :] = sample.rate
        block.step(tick, tick)
        commands = (float(block.outputs[told[0], 0]), float(block.outputs[told[1], 0]))
    inside = ran(deck, "shoulder.bed.shaft_rate")
    assert plant.shaft_rate == inside.signals["shoulder.bed.shaft_rate"][0, -1] != 0.0


@pytest.mark.slow
def test_the_work_of_its_motors_is_what_shaft_and_friction_take() -> None:
    (found,) = shaft_work(compiled(bench("rate_drive(delay = 1)"), "bench"), "shoulder")
    w = found.rate[0]
    given, taken = (found.drive + found.load)[0] * w, 0.0205 * np.abs(w) + 2.58e-5 * w**2
    kinetic = 0.5 * found.shaft[0] * (w[-1] ** 2 - w[0] ** 2)
    left = np.trapezoid(given - taken, found.time) - kinetic
    assert abs(left) < 0.01 * np.trapezoid(np.abs(found.drive[0] * w), found.time)


@pytest.mark.release
@pytest.mark.parametrize(
    "backend", ["reference", *(pytest.param(name, marks=pytest.mark.slow) for name in ("c", "wasm"))]
)
def test_every_back_end_gives_the_same_bits(backend: str) -> None:
    deck = bench("rate_drive(delay = 1, faults = typical)").replace("duration = 2 s", "duration = 0.1 s")
    experiment = compiled(deck, "bench")
    inputs, ticks = engine.inputs(experiment, np.arange(1)), experiment.structure.schedule.ticks
    found = [backends.load(record(build(experiment)), name=name).run(inputs, ticks)[0] for name in ("llvm", backend)]
    assert found[0] is not None and found[0].tobytes() == np.asarray(found[1]).tobytes()
