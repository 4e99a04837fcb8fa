"""A bed whose motor is of another size than the joint's: an exact model of it makes the same run at any scale."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from met import backends
from met import run as engine
from met.analysis.linear.answers import LinearQuestion
from met.analysis.margin import margins
from met.analysis.shaft_work import ShaftWork, shaft_work
from met.plan import Experiment, keys
from met.plan import file as plan_file
from met.program import build
from met.trace.recorder import record
from tests.batch import plans
from tests.substitution.hybrid import compiled

FAULTS = {
    "once": (0.002, "N*m"), "twice": (0.001, "N*m"), "tachometer": (0.1, "rad/s"), "converter_in": (0.1953125, "rad/s"),
    "converter_voltage": (0.009765625, "V"), "converter_current": (0.00146484375, "A"),
}  # fmt: skip
LOAD = {"kt_load": (0.072, "N*m/A"), "i_max": (3.0, "A")}
SCALES = {"torque": 25.0, "rate": 2.0, "voltage": 10.0}
WHOLE = {"torque": 16.0, "rate": 2.0, "voltage": 8.0}
"""Powers of two, by which nothing is rounded."""

POWERS = {"N*m": (1, 0, 0), "rad/s": (0, 1, 0), "V": (0, 0, 1), "A": (1, 1, -1), "N*m/A": (0, -1, 1)}


def text(
    scales: dict[str, float],
    *,
    law: str = "velocity_tracking",
    faults: bool = False,
    joints: tuple[str, ...] = ("shoulder",),
) -> str:
    """The runs `full`, on a bed of the joint's size, and `lab`, on its exact model of another size."""

    def bed(by: dict[str, float]) -> str:
        numbers = []
        for name, (value, unit) in (LOAD | (FAULTS if faults else {})).items():
            t, w, v = POWERS[unit]
            scale = by["torque"] ** t * by["rate"] ** w * by["voltage"] ** v
            numbers.append(f"{name} = {value / scale!r} {unit}")
        return f"emulated(delay = 1, unevenness = {0.02 if faults else 0.0}, {', '.join(numbers)})"

    one = dict.fromkeys(scales, 1.0)
    written = " ".join(f"{name} = {value!r};" for name, value in scales.items())
    full = "".join(f"substitute {each} {{ bed = {bed(one)};  law = {law}; }}\n" for each in joints)
    lab = "".join(
        f"substitute {each} {{ bed = {bed(scales)};  law = {law};  scale {{ {written} }} }}\n" for each in joints
    )
    own = ", ".join(f"{each}.bed.{name}" for each in joints for name in ("shaft_rate", "drive_voltage", "load_current"))
    return f"""
        #include <two_link.ic>
        run both like nominal {{
            rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}  duration = 2 s;  remove settle;
            record = [q, qd, tau];
        }}
        run full like both {{ {full} record += [{own}, law.torque]; }}
        run lab like both {{ {lab} record += [{own}, law.torque]; }}
        sweep sizes of lab {{
            zip {{ shoulder.bed.scale.torque = [1, 4, 25];  shoulder.bed.scale.rate = [1, 0.5, 3]; }}
        }}
    """


@lru_cache(maxsize=32)
def ran(deck: str, name: str) -> engine.Run:
    result = engine.run(compiled(deck, name))
    assert not result.status.any(), result.cause
    return result


def apart(deck: str) -> float:
    """The largest difference of a signal of the joints between `full` and `lab`, as a share of it."""
    one, other = ran(deck, "full"), ran(deck, "lab")
    return max(
        float(np.abs(one.signals[name] - other.signals[name]).max() / np.abs(one.signals[name]).max())
        for name in ("q", "qd", "tau", "law.torque")
    )


LAWS = ["velocity_tracking", "torque_balance_observer", "torque_balance", "bare", "measured_acceleration"]


@pytest.mark.release
@pytest.mark.parametrize("law", LAWS)
def test_an_exact_model_of_the_motor_makes_the_same_run_but_for_rounding(law: str) -> None:
    assert apart(text(SCALES, law=law)) < 1e-11


@pytest.mark.slow
@pytest.mark.parametrize(("faults", "scales"), [(False, WHOLE), (True, WHOLE | {"rate": 1.0})])
def test_where_nothing_is_rounded_the_bits_are_the_same(faults: bool, scales: dict[str, float]) -> None:
    """Noise and steps of converters over their scales too: also what goes on inside such a bed is that of the other.
    Not so what comes so many times a turn where rates are scaled, for the shaft then turns by another angle."""
    deck = text(scales, faults=faults)
    one, other = ran(deck, "full"), ran(deck, "lab")
    for name in ("q", "qd", "tau", "law.torque"):
        assert one.signals[name].tobytes() == other.signals[name].tobytes(), name
    torque, rate, voltage = scales.values()
    for name, scale in (("shaft_rate", rate), ("drive_voltage", voltage), ("load_current", torque * rate / voltage)):
        channel = f"shoulder.bed.{name}"
        assert (one.signals[channel] / scale).tobytes() == other.signals[channel].tobytes(), name


@pytest.mark.slow
def test_a_fault_of_once_a_turn_comes_at_another_time_where_rates_are_scaled() -> None:
    assert apart(text(WHOLE, faults=True)) > 1e-4


@pytest.mark.slow
def test_two_joints_on_scaled_beds_are_solved_together_as_on_others() -> None:
    assert apart(text(SCALES, joints=("shoulder", "elbow"))) < 1e-11


@pytest.mark.slow
def test_scales_of_1_are_no_scales_to_the_bit() -> None:
    deck = text(dict.fromkeys(SCALES, 1.0), faults=True)
    assert ran(deck, "full").signals["q"].tobytes() == ran(deck, "lab").signals["q"].tobytes()


@pytest.mark.slow
def test_a_sweep_of_the_scales_gives_each_case_its_own_motor() -> None:
    """What the bed takes from the servo is over each case's scale; the load motor stays, and is strong enough."""
    deck = text(dict.fromkeys(SCALES, 1.0))
    swept, own = ran(deck, "sizes"), ran(deck, "full")
    for case, rate in enumerate((1.0, 0.5, 3.0)):
        np.testing.assert_allclose(swept.signals["q"][case], own.signals["q"][0], rtol=1e-11)
        rates = swept.signals["shoulder.bed.shaft_rate"][case] * rate
        np.testing.assert_allclose(rates, own.signals["shoulder.bed.shaft_rate"][0], rtol=1e-10, atol=1e-10)


@pytest.mark.slow
def test_a_motor_that_is_no_exact_model_is_followed_for_what_it_is() -> None:
    """A bed's motor of 7 % more torque for a volt stands for a joint's motor of as much more: the run on the bed that
    is scaled is the run on one of the joint's size with that motor."""
    deck = text(SCALES)
    other = deck.replace("emulated(delay = 1,", "emulated(delay = 1, kt = 0.0653 N*m/A,", 1).replace(
        "emulated(delay = 1, unevenness", f"emulated(delay = 1, kt = {0.0653 * 2 / 10!r} N*m/A, unevenness"
    )
    assert other.count("kt = ") == 2
    assert apart(other) < 1e-11
    moved = np.abs(ran(other, "lab").signals["qd"] - ran(deck, "lab").signals["qd"]).max()
    assert moved > 1e-5, "and that is another run"


@pytest.mark.slow
@pytest.mark.parametrize("law", ["velocity_tracking", "measured_acceleration"])
def test_margins_and_poles_are_those_of_the_joint_s_size(law: str) -> None:
    """measured_acceleration has a limit of r; the whole program's poles at an instant say the same."""
    deck = text(SCALES, law=law)
    full, lab = compiled(deck, "full"), compiled(deck, "lab")
    ((one,),), ((other,),) = margins(full), margins(lab)
    assert (one.limit, one.lower, one.stable) == (
        None if other.limit is None else pytest.approx(other.limit, rel=1e-9), other.lower, other.stable,
    )  # fmt: skip
    assert (one.limit is None) == (law == "velocity_tracking")
    poles = [np.sort(np.abs([pole.z for pole in LinearQuestion(each, at=1.0).of(0).poles])) for each in (full, lab)]
    poles = [each[each > 1e-6] for each in poles]  # of what is gone after some ticks, rounding says how much is left
    np.testing.assert_allclose(poles[0], poles[1], rtol=1e-6, atol=1e-9)


@pytest.mark.slow
def test_a_scaled_bed_is_unstable_where_its_margin_says_so() -> None:
    """At r = 1.37 with three ticks of delay at 100 Hz: the run swings up, on the bed of either size."""
    deck = (
        text(SCALES, law="measured_acceleration")
        .replace("delay = 1", "delay = 3")
        .replace("servos = 1 kHz", "servos = 100 Hz")
    )
    for name in ("full", "lab"):
        experiment = compiled(deck, name)
        ((found,),) = margins(experiment)
        assert not found.stable
        result = engine.run(experiment)
        rates = result.signals["qd"][0, :, 0]
        assert not np.isfinite(rates).all() or np.abs(rates).max() > 0.06, "twice what it is commanded"


@pytest.mark.release
@pytest.mark.parametrize(
    "backend", ["reference", pytest.param("c", marks=pytest.mark.slow), pytest.param("wasm", marks=pytest.mark.slow)]
)
def test_every_back_end_gives_the_same_bits(backend: str) -> None:
    experiment = compiled(text(SCALES, faults=True).replace("duration = 2 s", "duration = 0.1 s"), "lab")
    recording = record(build(experiment))
    rows = [
        backends.load(recording, name=name).run(
            engine.inputs(experiment, np.arange(1)), experiment.structure.schedule.ticks
        )[0]
        for name in ("llvm", backend)
    ]
    assert rows[0] is not None and rows[0].tobytes() == np.asarray(rows[1]).tobytes()


def work(experiment: Experiment) -> ShaftWork:
    (found,) = shaft_work(experiment, "shoulder")
    return found


@pytest.mark.slow
def test_the_work_of_a_scaled_beds_motors_is_theirs() -> None:
    deck = text(SCALES)
    full, lab = work(compiled(deck, "full")), work(compiled(deck, "lab"))
    for name, scale in (
        ("rate", 2.0), ("acceleration", 2.0), ("drive", 25.0), ("load", 25.0), ("voltage", 10.0), ("arm", 12.5),
        ("rotor", 12.5), ("shaft", 12.5), ("kt", 5.0), ("kt_load", 5.0), ("strongest", 25.0),
    ):  # fmt: skip
        one, other = getattr(full, name), getattr(lab, name)
        np.testing.assert_allclose(other * scale, one, rtol=1e-9, atol=1e-9 * np.abs(one).max(), err_msg=name)


def test_a_plan_keeps_the_scales_and_its_key_knows_of_them() -> None:
    lab = compiled(text(SCALES), "lab")
    (again,) = plan_file.loads(plan_file.dumps(plans.plan(lab))).experiments
    (use,) = again.structure.substitutions
    assert use.scaled
    assert {name: again.parameters[f"shoulder.bed.scale.{name}"].value for name in SCALES} == SCALES
    unscaled = replace(lab.structure, substitutions=(replace(use, scaled=False),))
    assert keys.structure_key(unscaled) != keys.structure_key(lab.structure)
