"""A bed whose drive is told a torque: closed forms of its shaft, and runs beside those of a motor told a voltage."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np
import pytest

import ic
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
from met.trace.recorder import record
from tests.met.analysis.linear.test_beds import DECK as TURNER
from tests.met.analysis.linear.test_beds import with_loads
from tests.substitution.hybrid import compiled

LAWS = ["velocity_tracking", "torque_balance_observer", "torque_balance", "bare", "measured_acceleration"]
SLOW = 0.03

DECK = """
    #include <two_link.ic>
    run plain like nominal {
        rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }
        duration = 2 s;  remove settle;  record = [q, qd, tau];
    }
"""


def bench(bed: str, law: str = "velocity_tracking", more: str = "") -> str:
    return f"{DECK} run bench like plain {{ substitute shoulder {{ bed = {bed};  law = {law}; {more} }} }}"


@lru_cache(maxsize=64)
def ran(deck: str, record: str = "") -> engine.Run:
    name = "bench" if "run bench" in deck else "plain"
    text = deck + (f"run more like bench {{ record += [{record}]; }}" if record else "")
    result = engine.run(compiled(text, "more" if record else name))
    assert not result.status.any(), result.cause
    return result


def apart(deck: str, other: str) -> float:
    """The shoulder's rates apart, rms, as a share of the rate commanded."""
    rates = [ran(each).signals["qd"][0, :, 0] for each in (deck, other)]
    return float(np.sqrt(np.mean((rates[0] - rates[1]) ** 2)) / SLOW)


@pytest.mark.release
@pytest.mark.parametrize("law", LAWS)
def test_a_perfect_drive_makes_the_run_of_a_motor_told_a_voltage(law: str) -> None:
    """It is no further from the run in software. The voltage's torque changes in a tick by back-EMF, of which the drive
    is told the mean: that is the difference, a thousandth of the rate, where nothing else differs."""
    off = [apart(bench(f"{bed}(delay = 1)", law), DECK) for bed in ("torque_drive", "emulated")]
    assert off[0] < off[1] + 1e-4
    if law in ("velocity_tracking", "torque_balance_observer"):
        assert apart(bench("torque_drive(delay = 1)", law), bench("emulated(delay = 1)", law)) < 2e-4


@pytest.mark.slow
def test_what_a_drive_gives_too_much_is_found_as_the_unknown_torque() -> None:
    """7 % of what it is told, and the arm feels it: as a motor of 7 % more torque would move it."""
    deck = bench("torque_drive(delay = 1, gain = 1.07)", "velocity_tracking(drift = 1e-3 N^2*m^2/s)")
    found = ran(deck, "shoulder.bed.drive_torque, shoulder.law.unknown_torque").signals
    told, unknown = (found[f"shoulder.{name}"][0, 100:] for name in ("bed.drive_torque", "law.unknown_torque"))
    assert unknown.mean() == pytest.approx(0.07 * told.mean(), rel=0.02)
    assert told.mean() > 0.01


@pytest.mark.slow
def test_on_a_scaled_bed_it_is_the_same_run() -> None:
    kept = "tau_max = 0.144 N*m"
    full = bench(f"torque_drive(delay = 1, bandwidth = 500 Hz, {kept})")
    small = (
        f"torque_drive(delay = 1, bandwidth = 500 Hz, tau_max = {0.144 / 25!r} N*m, kt_load = {0.072 * 2 / 10!r} N*m/A)"
    )
    lab = bench(small, more="scale { torque = 25;  rate = 2;  voltage = 10; }")
    assert apart(full, lab) < 1e-11


def shaft(bed: str) -> Plant:
    return Plant(ic.compile(text=bench(bed), select=["bench"]).experiments[0], "shoulder")


@pytest.mark.slow
def test_a_shaft_without_friction_turns_as_newton_says() -> None:
    plant = shaft("torque_drive(f_c = 0 N*m, f_v = 0 N*m*s/rad, inertia = 1e-4 kg*m^2)")
    plant.start(2.0)
    for _ in range(500):
        plant.tick(0.01, -0.05)
    gained = (0.01 - 0.072 * 0.05) / 1e-4 * 0.5
    assert plant.shaft_rate == pytest.approx(2.0 + gained, rel=1e-7)


def test_the_torque_comes_as_a_low_pass_of_order_1() -> None:
    plant = shaft("torque_drive(bandwidth = 40 Hz, gain = 1.1, f_c = 0 N*m, f_v = 0 N*m*s/rad)")
    plant.start(0.0)
    for _ in range(20):
        plant.tick(0.01, 0.0)
    b = 2.0 * math.pi * 40.0
    w = 1.1 * 0.01 / 6.38e-5 * (0.02 - (1.0 - math.exp(-b * 0.02)) / b)
    assert plant.shaft_rate == pytest.approx(w, rel=1e-6)


@pytest.mark.slow
def test_no_more_torque_is_told_than_the_drive_gives() -> None:
    found = ran(
        bench("torque_drive(delay = 1, tau_max = 0.025 N*m)"), "shoulder.bed.drive_torque, shoulder.bed.motor_torque"
    )
    told, given = (found.signals[f"shoulder.bed.{name}"] for name in ("drive_torque", "motor_torque"))
    assert np.abs(told).max() == 0.025 and np.abs(given).max() == 0.025


def turner(law: str, loads: list[float], bed: str = "torque_drive(delay = 1, bandwidth = 300 Hz)") -> Experiment:
    deck = TURNER.replace("LAW", law).replace("RATE", "100 Hz")
    deck = deck.replace("emulated(delay = DELAY)", bed)
    (made,) = ic.compile(text=deck, select=["loads"]).experiments
    return with_loads(made, loads)


@pytest.mark.release
@pytest.mark.parametrize("law", ["measured_acceleration", "velocity_tracking"])
def test_a_pole_of_the_whole_program_leaves_the_unit_circle_at_the_limit_of_its_margin(law: str) -> None:
    rotor = 1570.0**2 * 6.38e-5
    ((found,),) = margins(turner(law, [rotor]))
    sides = [(False, 100.0)] if found.limit is None else [(False, 0.999 * found.limit), (True, 1.001 * found.limit)]
    assert (found.limit is None) == (law == "velocity_tracking")
    question = LinearQuestion(turner(law, [r * rotor for _, r in sides]))
    for case, (grows, r) in enumerate(sides):
        largest = max(abs(pole.z) for pole in question.of(case).poles)
        assert (largest > 1.0 + 1e-7) == grows, (r, largest)


@pytest.mark.slow
def test_at_a_port_it_is_told_torques_and_makes_the_same_bits() -> None:
    deck = bench("torque_drive(faults = typical, delay = 1)").replace("duration = 2 s", "duration = 0.5 s")
    experiment = compiled(deck, "bench")
    values = {
        path.removeprefix("shoulder.bed."): each.value
        for path, each in experiment.parameters.items()
        if path.startswith("shoulder.bed.")
    }
    plant = Plant(experiment, "shoulder")
    limits = emulated.limits(values, plant.period, voltage=0.288)  # type: ignore[arg-type]
    bed = EmulatedBed(plant, emulated.scales(values, "torque"), limits, drive="torque")  # type: ignore[arg-type]
    assert bed.connect().drive == "torque"
    program = build(experiment, wire=True, late=0)
    assert {"wire:shoulder.torque", "wire:shoulder.current"} <= set(program.outputs)
    block = backends.load(record(program), 4).block(np.zeros((1, len(program.inputs))))
    told = [program.outputs.index(f"wire:shoulder.{name}") for name in ("torque", "current")]
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
    deck = bench("torque_drive(delay = 1)")
    (found,) = shaft_work(compiled(deck, "bench"), "shoulder")
    w = found.rate[0]
    given, taken = (found.drive + found.load)[0] * w, 0.0205 * np.abs(w) + 2.58e-5 * w**2
    kinetic = 0.5 * found.shaft[0] * (w[-1] ** 2 - w[0] ** 2)
    left = np.trapezoid(given - taken, found.time) - kinetic
    assert abs(left) < 0.01 * np.trapezoid(np.abs(found.drive[0] * w), found.time)
    np.testing.assert_allclose(found.voltage, 2.05 / 0.061 * found.drive + 0.061 * found.rate, rtol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize(
    "backend", ["reference", *(pytest.param(name, marks=pytest.mark.slow) for name in ("c", "wasm"))]
)
def test_every_back_end_gives_the_same_bits(backend: str) -> None:
    deck = bench("torque_drive(delay = 1, faults = typical, bandwidth = 500 Hz)").replace(
        "duration = 2 s", "duration = 0.1 s"
    )
    experiment = compiled(deck, "bench")
    inputs, ticks = engine.inputs(experiment, np.arange(1)), experiment.structure.schedule.ticks
    rows = [backends.load(record(build(experiment)), name=name).run(inputs, ticks)[0] for name in ("llvm", backend)]
    assert rows[0] is not None and rows[0].tobytes() == np.asarray(rows[1]).tobytes()
