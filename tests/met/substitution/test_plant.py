"""The emulated bed by itself: the kernel's bits where it takes the bed's place, and the same bits in C."""

from __future__ import annotations

import subprocess
from pathlib import Path

import numpy as np
import pytest

import ic
from met.backends.llvm import kernel
from met.plan import REPEAT, Experiment
from met.plant import Plant, plant_c
from met.program import build
from met.run import inputs
from tests.met.trace.compiled import STRICT, answered, different, made, need

FOLDER = Path(__file__).parent
FIRMWARE = Path(__file__).parents[3] / "hw" / "firmware"

DECK = """
#include <two_link.ic>
run paper like nominal {{
    rates {{ dynamics = {dynamics} Hz;  servos = {servos} Hz;  record = {dynamics} Hz; }}
    substitute shoulder {{ bed = emulated(faults = {faults}, delay = {delay});  law = {law}; }}
    {more}
    record += [qdd, shoulder.law.rate, shoulder.bed.drive_voltage, shoulder.bed.load_current, shoulder.bed.shaft_rate,
               shoulder.bed.shaft_angle];
}}
sweep several of paper {{
    vary gearbox.kt = [0.05, 0.061] N*m/A;
    vary shoulder.bed.inertia = [2e-4, 3.1e-4] kg*m^2;
    vary links.upper.mass = [40, 47] kg;
    repeat 2;
}}
"""
HERE = [("gcc", "-O0"), ("gcc", "-O3", "-mfma"), ("clang", "-O2")]
ARM = ("arm-none-eabi-gcc", "-O2")


def experiment(
    name: str = "paper",
    *,
    dynamics: int = 25,
    servos: int = 100,
    faults: str = "typical",
    delay: int = 0,
    law: str = "velocity_tracking",
    more: str = "",
) -> Experiment:
    text = DECK.format(dynamics=dynamics, servos=servos, faults=faults, delay=delay, law=law, more=more)
    return ic.compile(text=text, select=[name]).experiments[0]


def assert_same_run(found: Experiment, case: int = 0, ticks: int | None = None) -> None:
    """A case with the beds inside the kernel, and with plants at the wire: the same bits in all that is recorded."""
    schedule = found.structure.schedule
    ticks = schedule.ticks if ticks is None else ticks
    brought = inputs(found, np.array([case]))
    inside = kernel.compile(build(found)).run(brought, ticks)[0]
    assert inside is not None

    joints = [use.joint for use in found.structure.substitutions]
    split = build(found, wire=True)
    block = kernel.compile(split).block(np.column_stack([brought, np.zeros((1, len(joints)))]))
    columns = [channel for recorded in found.structure.record for channel in recorded.channels]
    divisor = next(use.divisor for use in found.structure.servos if use.joint == joints[0])
    given = dict(zip(split.inputs, brought[0], strict=False))
    plants = {joint: Plant(found, joint, case=case) for joint in joints}
    for joint, plant in plants.items():
        assert plant.period == divisor / schedule.base_hz
        rate = plant.start(0.0, float(found.cases.seed), given.get(REPEAT, 0.0))
        block.inputs[split.inputs.index(f"wire:{joint}.rate"), :] = rate
    rows = []
    for k in range(ticks + 1):
        for joint, plant in plants.items():
            if k and k % divisor == 0:
                voltage, current = (
                    block.outputs.item(split.outputs.index(f"wire:{joint}.{name}"), 0)
                    for name in ("voltage", "current")
                )
                block.inputs[split.inputs.index(f"wire:{joint}.rate"), :] = plant.tick(voltage, current)
        row = block.recorded(k, k)[0]
        if k % schedule.record == 0:
            for joint, plant in plants.items():
                for name in ("shaft_rate", "shaft_angle"):
                    if f"{joint}.bed.{name}" in columns:
                        row[0, columns.index(f"{joint}.bed.{name}")] = getattr(plant, name)
            rows.append(row[0])
    assert np.ptp(inside[0], axis=0).min() > 0.0
    assert different(inside[0], np.array(rows)) == 0


@pytest.mark.release
@pytest.mark.parametrize("faults", ["none", "typical"])
@pytest.mark.parametrize(("dynamics", "servos"), [(25, 100), (1000, 1000)])
def test_at_the_wire_it_makes_the_run_of_the_bed_inside_to_the_bit(dynamics: int, servos: int, faults: str) -> None:
    """All 20 s of the paper's test, and the same at 1 kHz."""
    assert_same_run(experiment(dynamics=dynamics, servos=servos, faults=faults))


@pytest.mark.release
@pytest.mark.parametrize(("law", "delay"), [("torque_balance_observer", 0), ("torque_balance", 2)])
def test_so_it_does_under_other_laws_and_with_a_delay(law: str, delay: int) -> None:
    assert_same_run(experiment(dynamics=250, servos=500, law=law, delay=delay), ticks=2000)


@pytest.mark.slow
def test_so_do_two_at_two_wires() -> None:
    more = "substitute elbow { bed = emulated(faults = typical, once = 0.004 N*m); }  record += [elbow.bed.shaft_rate];"
    found = experiment(dynamics=250, servos=500, more=more)
    assert [use.joint for use in found.structure.substitutions] == ["shoulder", "elbow"]
    assert_same_run(found, ticks=2000)


@pytest.mark.release
@pytest.mark.parametrize("case", [0, 5, 14])
def test_a_case_of_a_sweep_over_the_bed_has_its_own_plant(case: int) -> None:
    found = experiment("several", dynamics=250, servos=500)
    assert found.cases.count == 16
    assert_same_run(found, case, ticks=1000)


@pytest.mark.slow
def test_another_noise_or_another_case_is_another_plant() -> None:
    found = experiment("several")
    one, other = Plant(found, "shoulder", period=0.002), Plant(found, "shoulder", case=15, period=0.002)
    ends = []
    for plant, seed, repeat in ((one, 0.0, 0.0), (one, 1.0, 0.0), (one, 0.0, 1.0), (other, 0.0, 0.0), (one, 0.0, 0.0)):
        plant.start(1.0, seed, repeat)
        rates = [plant.tick(6.0, -0.2) for _ in range(50)]
        ends.append((plant.shaft_rate, plant.shaft_angle, *rates))
    assert ends[0] == ends[4]
    assert ends[0][:2] == ends[1][:2]  # noise is the tachometer's: the shaft does not feel it
    assert len({end[2:] for end in ends[:4]}) == 4


def questions(ticks: int, seed: int) -> np.ndarray:
    """Two runs as run_plant.c takes them, the second begun anew: voltages and currents at random, beyond limits too."""
    rng = np.random.default_rng(seed)
    parts = []
    for rate, noise, repeat in ((0.0, 0.0, 0.0), (-31.25, 2.0**53 - 1.0, 7.0)):
        held = np.column_stack([rng.normal(0.0, 12.0, ticks // 2), rng.normal(0.0, 1.5, ticks // 2)])
        held = np.repeat(held, rng.integers(1, 40, ticks // 2), axis=0)[: ticks // 2]
        held[rng.random(ticks // 2) < 0.1] = 0.0
        parts += [[len(held), rate, noise, repeat], held.ravel()]
    return np.concatenate(parts)


def stepped(plant: Plant, question: np.ndarray) -> np.ndarray:
    """What run_plant.c answers, by the plant in this process."""
    rows, at = [], 0
    while at < len(question):
        ticks, *begin = question[at : at + 4].tolist()
        rows.append((plant.start(*begin), plant.shaft_rate, plant.shaft_angle))
        at += 4
        for voltage, current in question[at : at + 2 * int(ticks)].reshape(-1, 2).tolist():
            rows.append((plant.tick(voltage, current), plant.shaft_rate, plant.shaft_angle))
        at += 2 * int(ticks)
    return np.array(rows)


def program(found: Experiment, period: float | None) -> str:
    return plant_c(found, "shoulder", period=period) + '#include "run_plant.c"\n'


@pytest.mark.compiler
@pytest.mark.parametrize("faults", ["none", "typical"])
@pytest.mark.parametrize("words", HERE, ids=" ".join)
def test_in_c_it_has_the_same_bits(tmp_path: Path, words: tuple[str, ...], faults: str) -> None:
    found, question = experiment(faults=faults), questions(20_000, 1)
    command = made(tmp_path, program(found, 0.002), (*words, f"-I{FOLDER}"), include=FIRMWARE)
    ours = stepped(Plant(found, "shoulder", period=0.002), question)
    assert np.abs(ours).max(axis=0).min() > 20.0
    assert different(ours, answered(command, question).reshape(-1, 3)) == 0


@pytest.mark.firmware
@pytest.mark.parametrize(("faults", "period"), [("none", 0.002), ("typical", 0.002), ("typical", 0.001)])
def test_on_a_controller_without_floating_point_it_has_the_same_bits(
    tmp_path: Path, faults: str, period: float
) -> None:
    found, question = experiment(faults=faults), questions(2000, 2)
    command = made(tmp_path, program(found, period), (*ARM, f"-I{FOLDER}"), include=FIRMWARE)
    ours = stepped(Plant(found, "shoulder", period=period), question)
    assert different(ours, answered(command, question).reshape(-1, 3)) == 0


@pytest.mark.slow
def test_the_text_is_the_same_each_time_and_another_cases_is_another() -> None:
    found = experiment("several")
    text = plant_c(found, "shoulder", case=3, period=0.002)
    assert text == plant_c(found, "shoulder", case=3, period=0.002)
    assert text != plant_c(found, "shoulder", case=15, period=0.002)


@pytest.mark.release
@pytest.mark.compiler
@pytest.mark.parametrize("level", ["-O0", "-Os", "-O3"])
@pytest.mark.parametrize(
    "words",
    [
        ("gcc",),
        ("clang",),
        pytest.param(("arm-none-eabi-gcc", "-mcpu=cortex-m3", "-mthumb"), marks=pytest.mark.firmware),
    ],
)
def test_it_asks_for_no_library_but_the_compilers_own_arithmetic(
    tmp_path: Path, words: tuple[str, ...], level: str
) -> None:
    need(words[0])
    text = plant_c(experiment("several"), "shoulder", case=3, period=0.002)
    (tmp_path / "plant.c").write_text(text, encoding="utf-8")
    command = [
        *words,
        *STRICT,
        level,
        "-ffreestanding",
        f"-I{FIRMWARE}",
        "-c",
        "-o",
        tmp_path / "plant.o",
        tmp_path / "plant.c",
    ]
    subprocess.run(command, check=True)
    named = subprocess.run(["nm", tmp_path / "plant.o"], capture_output=True, text=True, check=True).stdout
    outside = {line.split()[-1] for line in named.splitlines() if line.split()[-2].isupper()}
    assert {name for name in outside if not name.startswith("__aeabi_")} == {
        "plant_period",
        "plant_start",
        "plant_tick",
        "plant_rate",
        "plant_shaft_rate",
        "plant_shaft_angle",
    }


def test_a_joint_whose_motor_is_its_own_has_no_plant() -> None:
    with pytest.raises(ValueError, match=r"^joint 'elbow' is not substituted$"):
        Plant(experiment(), "elbow")
