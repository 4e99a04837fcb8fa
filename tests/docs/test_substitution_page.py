"""docs/substitution.md says what runs: its deck, what its laws are off; and docs/linear.md its limits."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import ic
from met import run as engine
from met.plan import Experiment
from tests.paper.stability_map import limits

PAGE = (Path(__file__).parents[2] / "docs" / "substitution.md").read_text(encoding="utf-8")
PROSE = " ".join(PAGE.split())
LINEAR = (Path(__file__).parents[2] / "docs" / "linear.md").read_text(encoding="utf-8")
DECK, MOTORS, CRANE = re.findall(r"```c\n(.*?)```", PAGE, re.DOTALL)
RATIO, SLOW = 1570.0, 0.03
LIGHT_TO_HEAVY = (0.5, 1.5, 5.0, 20.0)


def experiment(more: str, name: str) -> Experiment:
    return ic.compile(text=DECK + more, select=[name]).experiments[0]


@pytest.mark.slow
def test_the_deck_of_the_page_runs() -> None:
    result = engine.run(experiment("", "bench"))
    assert result.cause == [""]
    shaft = result.signals["swing.bed.shaft_rate"].ravel()
    # After 5 s, with an arm of five rotors; the error of the whole course is held to below.
    assert abs(shaft[-1] / RATIO / SLOW - 1.0) < 0.01


@pytest.mark.slow
def test_as_many_motors_pass_as_the_page_says() -> None:
    result = engine.run(experiment(MOTORS, "motors"), record=False)
    met = result.met["late < 1.8 s"]
    (said, of) = re.search(r"met by (\d+) of (\d+) cases", PAGE).groups()  # type: ignore[union-attr]
    assert (met.sum(), met.size) == (int(said), int(of))
    passing = met.reshape(100, 3).sum(axis=1)
    assert f"{(passing == 3).sum()} motors pass and {(passing == 0).sum()} do not" in PROSE
    worst = int(np.argmax(result.metrics["late"]))
    assert f"--case '#{worst}'" in PAGE


@pytest.mark.slow
def test_the_crane_of_the_page_is_off_by_what_it_says(tmp_path: Path) -> None:
    (tmp_path / "crane.ic").write_text(CRANE, encoding="utf-8")
    names = ("software", "full", "exact", "lab", "faulty", "larger")
    rates = {}
    for name in names:
        result = engine.run(ic.compile(tmp_path / "crane.ic", select=[name]).experiments[0])
        assert not result.status.any() and not result.limited.any()
        rates[name] = result.signals["qd"][0, :, 0]

    def off(name: str, other: str) -> str:
        return f"{100.0 * np.sqrt(np.mean((rates[name] - rates[other]) ** 2)) / 0.5:.2f} %"

    assert np.abs(rates["exact"] - rates["full"]).max() < 1e-12
    for name in ("full", "exact"):
        assert re.search(rf"^\| `{name}`, [^|]* \| {off(name, 'software')} \| \|$", PAGE, re.MULTILINE), name
    for name in ("lab", "faulty"):
        two = f"{off(name, 'software')} \\| {off(name, 'larger')}"
        assert re.search(rf"^\| `{name}`, [^|]* \| {two} \|$", PAGE, re.MULTILINE), name
    assert f"differs from `software` by {off('larger', 'software')}." in PROSE


DRIVES = re.findall(r"^\| `(\w+)` \| (\S+) % \| (\S+) % \|$", PAGE, re.MULTILINE)


def off_on_beds(folder: Path, beds: dict[str, str]) -> list[str]:
    """Errors of the shoulder of two_link.ic on these beds, by law, against its run in software: `0.14`."""
    runs = "".join(
        f"run on_{n} like own {{ substitute shoulder {{ bed = {bed};  law = {law}; }} }}\n"
        for n, (bed, law) in enumerate(beds.items())
    )
    (folder / "drives.ic").write_text(
        "#include <two_link.ic>\nrun own like nominal { rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }"
        f"  duration = 5 s;  remove settle;  record = [qd]; }}\n{runs}",
        encoding="utf-8",
    )
    rates = [
        engine.run(ic.compile(folder / "drives.ic", select=[name]).experiments[0]).signals["qd"][0, :, 0]
        for name in ("own", *(f"on_{n}" for n in range(len(beds))))
    ]
    return [f"{100.0 * np.sqrt(np.mean((each - rates[0]) ** 2)) / SLOW:#.2g}" for each in rates[1:]]


@pytest.mark.release
@pytest.mark.parametrize("row", DRIVES, ids=[row[0] for row in DRIVES])
def test_a_drive_told_a_torque_is_off_by_what_the_page_says(row: tuple[str, str, str], tmp_path: Path) -> None:
    beds = {"emulated(delay = 1)": row[0], "torque_drive(delay = 1)": row[0]}
    assert off_on_beds(tmp_path, beds) == [*row[1:]]


@pytest.mark.slow
def test_so_is_one_that_is_slow_or_gives_too_much_or_has_faults(tmp_path: Path) -> None:
    beds = [
        "torque_drive(delay = 1, bandwidth = 300 Hz)", "torque_drive(delay = 1, gain = 1.07)",
        "torque_drive(delay = 1, faults = typical, bandwidth = 1 kHz)", "emulated(delay = 1, faults = typical)",
    ]  # fmt: skip
    slow, much, typical, voltage = off_on_beds(tmp_path, dict.fromkeys(beds, "velocity_tracking"))
    assert f"is {slow} % with a current loop of 300 Hz. It is {much} % with a drive that gives 7 % too much" in PROSE
    assert f"It is {typical} % with typical faults and a loop of 1 kHz (`emulated`: {voltage} %)" in PROSE


SOFT = "velocity_tracking(drift = 1e-3 N^2*m^2/s)"


@pytest.mark.release
def test_a_drive_told_a_rate_is_off_by_what_the_page_says(tmp_path: Path) -> None:
    """Against the run in software at 4 kHz of the loop that the drive has."""
    gains = {
        "the deck's": "",
        "`kp` 20 % more than the deck's": "kp = 0.024 V*s/rad",
        "`ki` 28 % more": "ki = 0.16 V/rad",
        "`kp` five times, `ki` eight times": "kp = 0.1 V*s/rad, ki = 1 V/rad",
    }
    runs: dict[str, tuple[str, str]] = {}
    for n, own in enumerate(gains.values()):
        runs[f"there_{n}"] = (f"servos {{ shoulder {{ {own.replace(',', ';')}{';' * bool(own)} }} }}", "fine")
        for name, law in (("bed", "velocity_tracking"), ("soft", SOFT)):
            bed = f"rate_drive(delay = 1{', ' * bool(own)}{own})"
            runs[f"{name}_{n}"] = (f"substitute shoulder {{ bed = {bed};  law = {law}; }}", "own")
    for name, bed, law in (
        ("at_once", "rate_drive()", "velocity_tracking"),
        ("faulty", "rate_drive(delay = 1, faults = typical)", "velocity_tracking"),
        ("measured", "rate_drive(delay = 1)", "measured_acceleration"),
        ("balance", "rate_drive(delay = 1)", "torque_balance"),
    ):
        runs[name] = (f"substitute shoulder {{ bed = {bed};  law = {law}; }}", "own")
    (tmp_path / "rates.ic").write_text(
        "#include <two_link.ic>\nrun own like nominal { rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }"
        "  duration = 5 s;  remove settle;  record = [qd]; }\n"
        "run fine like own { rates { base = 4 kHz;  dynamics = 4 kHz;  servos = 4 kHz; } }\n"
        + "".join(f"run {name} like {base} {{ {body} }}\n" for name, (body, base) in runs.items()),
        encoding="utf-8",
    )

    def rate(name: str) -> np.ndarray:
        experiment = ic.compile(tmp_path / "rates.ic", select=[name]).experiments[0]
        found: np.ndarray = engine.run(experiment).signals["qd"][0, :, 0]
        return found

    def off(one: np.ndarray, other: np.ndarray) -> str:
        return f"{100.0 * np.sqrt(np.mean((one - other) ** 2)) / SLOW:#.2g}".rstrip(".")

    plain = rate("fine")
    for n, words in enumerate(gains):
        there = rate(f"there_{n}")
        bed, soft = off(rate(f"bed_{n}"), there), off(rate(f"soft_{n}"), there)
        row = f"| {words} | {off(there, plain)} % | {bed} % | {soft} % |" if n else f"| {words} | | {bed} % | |"
        assert row in PAGE
    said = {name: off(rate(name), plain) for name in ("at_once", "faulty", "measured", "balance")}
    assert f"Without a delay the error is {said['at_once']} %" in PROSE
    assert f"With typical faults it is {said['faulty']} %" in PROSE
    assert f"`measured_acceleration` needs no torque: its error is {said['measured']} %" in PROSE
    assert f"follows no other: its error is {said['balance']} %" in PROSE


@pytest.mark.slow
@pytest.mark.parametrize("rate", ["100 Hz", "200 Hz", "1 kHz", "2 kHz"])
def test_the_limits_of_the_page_are_those_that_are_predicted(rate: str) -> None:
    (row,) = re.findall(rf"^\| {rate} \| (\S+) \| (\S+) \| (\S+) \|$", LINEAR, re.MULTILINE)
    found = limits("measured_acceleration", float(rate.split()[0]) * (1000.0 if "kHz" in rate else 1.0))
    assert row == tuple(f"{limit:#.3g}" for limit in found if limit is not None)


@pytest.mark.slow
def test_an_arm_that_is_too_light_rings_where_the_page_says() -> None:
    more = """
        run stiff like bench { rates { record = 1 kHz; }  record = [swing.servo.voltage]; }
        sweep arms of stiff { vary gearbox.kp = [1] V*s/rad;  vary r = [0.1, 0.3, 0.5, 0.6, 5]; }
    """
    voltage = engine.run(experiment(more, "arms")).signals["swing.servo.voltage"].reshape(5, -1)
    *ringing, smooth, heavy = voltage[:, -1000:].std(axis=1)
    assert f"{' / '.join(f'{each:.1f}' for each in ringing)} V rms at r = 0.1 / 0.3 / 0.5" in LINEAR
    assert f"{smooth:.3f} {heavy:.3f}" == "0.004 0.004"


def off(law: str, bed: str = "emulated", servos: int = 1000, dynamics: int = 1000) -> str:
    """Errors of the page's deck from its lightest to its heaviest arm, after each step: `0.13 / 0.13 / 0.14 / 0.17`."""
    rates = f"base = {servos} Hz; dynamics = {dynamics} Hz; servos = {servos} Hz; record = {dynamics} Hz;"
    more = f"""
        run mixed like bench {{ swing {{ bed = {bed};  law = {law}; }}  rates {{ {rates} }} }}
        run pure like software {{ rates {{ base = 1 kHz; servos = {servos} Hz; record = {dynamics} Hz; }} }}
        sweep beds of mixed {{ vary links.beam.mass = {masses()}; }}
        sweep pures of pure {{ vary links.beam.mass = {masses()}; }}
    """
    mixed, pure = (engine.run(experiment(more, name)) for name in ("beds", "pures"))
    shaft = mixed.signals["swing.bed.shaft_rate"].reshape(len(LIGHT_TO_HEAVY), -1) / RATIO
    found = 100.0 * np.sqrt(np.mean((shaft - pure.signals["qd"][:, :, 0]) ** 2, axis=1)) / SLOW
    return " / ".join(f"{each:#.2g}".rstrip(".") for each in found)


LAWS = ["velocity_tracking", "torque_balance_observer", "torque_balance", "bare"]


def columns(law: str) -> list[str]:
    (row,) = re.findall(rf"^\| `{law}` \| ([^|]*/.*) \|$", PAGE, re.MULTILINE)
    return [each.removesuffix(" %") for each in row.split(" | ")]


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_the_errors_of_the_page_are_those_of_its_deck(law: str) -> None:
    """At 1 kHz, without faults and delay; the third digit is the page's rounding."""
    assert columns(law)[0] == off(law)


@pytest.mark.release
@pytest.mark.parametrize("law", LAWS)
def test_so_are_those_at_the_papers_rates_and_with_faults(law: str) -> None:
    slow, faulty = off(law, servos=100, dynamics=25), off(law, "emulated(faults = typical)")
    assert columns(law)[1:] == [slow, faulty]


FAULTS = re.findall(r"^\| `(\w+)` = (\S+) (\S+) \| ([^|]*/[^|]*) \| ([^|]*/[^|]*) \|", PAGE, re.MULTILINE)


@pytest.mark.release
@pytest.mark.parametrize("fault", FAULTS, ids=[row[0] for row in FAULTS])
def test_so_are_those_of_each_fault_alone(fault: tuple[str, ...]) -> None:
    name, size, unit, fast, slow = fault
    bed = f"emulated({name} = {size} {'N*m' if unit == 'N' else unit})"
    assert off("velocity_tracking", bed) == fast
    assert off("velocity_tracking", bed, servos=100, dynamics=25) == slow


def masses() -> str:
    return "[" + ", ".join(f"{r} * rotor / 1 m^2" for r in LIGHT_TO_HEAVY) + "]"
