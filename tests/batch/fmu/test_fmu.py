"""FMUs that are loaded by ctypes: the bits of `met run`, steps on and off the ticks, states, wrong calls, memory."""

from __future__ import annotations

import math
import shutil
import subprocess
from ctypes import byref, c_size_t, c_void_p
from pathlib import Path

import numpy as np
import pytest

import ic
from batch import Simulation
from tests.batch.fmu.arms import NAMES, SHORT, begin_case, deck, load, packed, run_rows, run_sanitized
from tests.batch.fmu.master import DISCARD, ERROR, OK, Fmu, Instance

pytestmark = [pytest.mark.compiler]

SPEED = 0.010471975511965978
"""0.1 rpm in rad/s, rounded once."""

DECKS = Path(ic.__file__).parent / "decks"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmu")


@pytest.fixture(scope="module")
def fmu(folder: Path) -> Fmu:
    return load(packed(folder), folder)


@pytest.fixture
def new(fmu: Fmu) -> Instance:
    return fmu.instance()


def bits(numbers: object) -> bytes:
    return np.asarray(numbers, dtype=float).tobytes()


@pytest.mark.slow
@pytest.mark.parametrize("case", range(3))
def test_a_case_of_a_sweep_has_the_bits_of_its_run(fmu: Fmu, folder: Path, case: int) -> None:
    found = deck(folder)
    times, rows, metrics = run_rows(found, case)
    instance = fmu.instance()
    begin_case(instance, found, case)
    assert bits(instance.rows(times)) == bits(rows)
    assert {name: instance.get(f"metrics.{name}")[0] for name in metrics} == metrics
    assert instance.reached == 2.0 and instance.call("fmi3Terminate") == OK
    assert bits(instance.get(*fmu.outputs)) == bits(rows[-1])


PUBLISHED = [
    ("two_link.ic", "hybrid"),
    ("panda.ic", "reach"),
    ("station_arm.ic", "station_arm_driven"),
    ("free_flyer.ic", "flyer_drifting"),
    ("shuttle_booms.ic", None),
    ("soft_capture.ic", None),
]
"""Noise on a bed, friction, tables, a free base, booms and grapples."""


@pytest.mark.release
@pytest.mark.parametrize(("file", "name"), PUBLISHED)
def test_published_decks_have_the_bits_of_their_runs(tmp_path: Path, file: str, name: str | None) -> None:
    from batch.fmu.package import fmu_of

    (found,) = ic.compile(DECKS / file, select=[name] if name else None).experiments[:1]
    times, rows, metrics = run_rows(found, 0)
    instance = load(fmu_of(found), tmp_path).instance()
    begin_case(instance, found, 0)
    assert bits(instance.rows(times)) == bits(rows)
    assert bits([instance.get(f"metrics.{name}")[0] for name in metrics]) == bits(list(metrics.values()))


@pytest.mark.slow
def test_steps_of_any_length_see_the_same_motion(fmu: Fmu, folder: Path) -> None:
    times, rows, _ = run_rows(deck(folder), 1)
    draw = np.random.default_rng(5)
    points = np.cumsum(draw.uniform(0.0, 0.03, 400))
    points = np.unique(np.concatenate([points[points < 2.0], times]))
    instance = fmu.instance()
    begin_case(instance, deck(folder), 1)
    found = instance.rows(points)
    assert bits(found[np.isin(points, times)]) == bits(rows)
    ticks = fmu.instance()
    begin_case(ticks, deck(folder), 1)
    at_ticks = ticks.rows(np.arange(401) * 0.005)
    assert bits(found) == bits(at_ticks[np.floor(points / 0.005 + 1e-2).astype(int)])


@pytest.mark.slow
@pytest.mark.parametrize("start", [1e10, -1e10])
def test_a_start_far_from_0_keeps_the_ticks(fmu: Fmu, folder: Path, start: float) -> None:
    times, rows, _ = run_rows(deck(folder), 0)
    instance = fmu.instance()
    assert instance.enter(start) == OK and instance.leave() == OK
    assert bits(instance.rows(start + times)) == bits(rows)  # the times are rounded to 4e-4 ticks


def test_times_that_do_not_resolve_ticks_are_refused(new: Instance) -> None:
    assert new.enter(1e12) == ERROR
    assert new.messages == ["the start is so large that ticks are lost in rounding"]
    assert new.enter() == OK and new.leave() == OK and new.step(0.0, 1e12) == ERROR
    assert new.messages[-1] == "the step leads to where ticks are lost in rounding"
    assert new.step(0.0, 0.04) == OK


SOWN = """\
#include <two_link.ic>
run noisy like hybrid { duration = 0.4 s;  remove settle; }
sweep sown of noisy { vary gearbox.kp = [0.02, 0.03] V*s/rad;  repeat 2;  seeds = independent; }
"""


@pytest.mark.slow
def test_noise_has_the_bits_of_its_case(tmp_path: Path) -> None:
    found = deck(tmp_path, "sown", SOWN)
    fmu = load(packed(tmp_path, "sown", SOWN), tmp_path)
    for name in found.cases.noise:
        start, most = (float(fmu.attributes[name][key]) for key in ("start", "max"))
        assert 0.0 <= start <= most
    times, rows, _ = run_rows(found, 1)
    instance, other = fmu.instance(), fmu.instance()
    begin_case(instance, found, 1)
    begin_case(other, found, 0)
    assert bits(instance.rows(times)) == bits(rows) != bits(other.rows(times))


DRIVEN = """\
#include <two_link.ic>
servo outside { model = external;  command = torque(0 N*m); }
run mixed like nominal { duration = 2 s;  remove settle;  servos { elbow = outside; } }
sweep driven of mixed {
    vary shoulder.servo.command.value = [0, 0.1] rad/s;
    vary elbow.servo.command.value = [0, 1] N*m;
}
"""


@pytest.mark.slow
def test_inputs_that_change_have_the_bits_of_a_stepped_run(tmp_path: Path) -> None:
    fmu = load(packed(tmp_path, "driven", DRIVEN), tmp_path)
    stepped = Simulation(text=DRIVEN, run="mixed").start(commands=["shoulder", "elbow"])
    instance = fmu.instance()
    instance.begin()
    angles = ("shoulder.q", "elbow.q", "shoulder.qd", "elbow.qd")
    for step in range(40):
        seen = stepped.seen
        assert bits(instance.get(*angles)) == bits([*seen.q, *seen.qd]), step
        commands = [0.2 * math.sin(0.2 * step), -50.0 * seen.q[1] - 20.0 * seen.qd[1]]
        stepped.step(commands)
        assert instance.set("shoulder.servo.command.value", commands[0]) == OK
        assert instance.set("elbow.servo.command.value", commands[1]) == OK
        assert instance.step(step * 0.04, 0.04) == OK
    assert np.ptp(stepped.seen.q) > 1e-3 and fmu.attributes["elbow.servo.command.value"]["unit"] == "N.m"


@pytest.mark.slow
def test_a_wrench_that_changes_pushes_as_one_of_the_deck_with_a_window(tmp_path: Path) -> None:
    text = SHORT.replace("force = [1, 0, 0] N", "force = [0, 9, 0] N;  from = 0.4 s;  until = 1.2 s")
    _, rows, _ = run_rows(deck(tmp_path, "brief", text), 0)
    free = SHORT + "sweep pushed of brief { vary environment.push.force.y = [0, 1] N; }\n"
    fmu = load(packed(tmp_path, "pushed", free.replace("[1, 0, 0]", "[0, 0, 0]")), tmp_path)
    instance = fmu.instance()
    instance.begin()
    found = [instance.get(*fmu.outputs)]
    for row in range(50):
        assert instance.set("environment.push.force.y", 9.0 if 10 <= row < 30 else 0.0) == OK
        assert instance.step(row * 0.04, 0.04) == OK
        found.append(instance.get(*fmu.outputs))
    # Only the order of products differs: a share of the force in the deck's model.
    assert np.allclose(found, rows, rtol=0.0, atol=1e-12) and np.ptp(rows[:, 1]) > 1e-3


def test_variables_have_units_bounds_and_start_values(fmu: Fmu) -> None:
    of = fmu.attributes
    assert [of[name]["causality"] for name in NAMES] == ["parameter", "parameter", "input", "input"]
    speed = of["shoulder.servo.command.value"]
    assert (speed["unit"], speed["displayUnit"], float(speed["start"])) == ("rad/s", "rpm", SPEED)
    assert of["gearbox.kp"]["min"] == "0.0" and of["gearbox.kp"]["unit"] == "V.s/rad"
    assert of["gearbox.kp"]["description"].startswith("proportional gain")
    assert of["links.lower.position.x"] | {"valueReference": ""} == {
        "name": "links.lower.position.x", "valueReference": "", "causality": "output", "variability": "continuous",
        "initial": "calculated", "unit": "m", "description": "position of the origin of the link's frame",
    }  # fmt: skip
    assert of["metrics.volts"]["causality"] == "local"


def test_outputs_follow_inputs_and_parameters_until_the_run_begins(new: Instance) -> None:
    assert new.get(*NAMES) == [15.0, 0.01, SPEED, 0.0]
    status, _ = new.ask("shoulder.q")
    assert status == ERROR and new.messages == ["outputs are known from the initialization on"]
    assert new.enter() == OK
    before = new.get("shoulder.servo.voltage")
    assert new.set("gearbox.kp", 0.02) == OK
    after = new.get("shoulder.servo.voltage")
    assert after[0] == pytest.approx(2.0 * before[0], rel=1e-12) and before[0] > 0.0
    assert new.leave() == OK and new.get("shoulder.servo.voltage") == after
    assert new.set("shoulder.servo.command.value", 0.0) == OK
    assert new.get("shoulder.servo.voltage") == [0.0] and new.get("time") == [0.0]


def test_calls_in_the_wrong_order_are_refused_and_change_nothing(new: Instance) -> None:
    assert new.step(0.0, 0.04) == ERROR and new.leave() == ERROR and new.call("fmi3Terminate") == ERROR
    assert new.enter(math.nan) == ERROR and new.enter(1.0, 0.5) == ERROR
    assert new.enter(1.0, 2.0) == OK and new.enter() == ERROR and new.leave() == OK
    refused = [(0.0, 0.04), (1.04, 0.04), (1.0, 0.0), (1.0, -0.04), (1.0, math.nan), (1.0, math.inf), (1.0, 1e300),
               (math.nan, 0.04), (1.0, 1.04)]  # fmt: skip
    before = new.get(*new.fmu.outputs)
    assert [new.step(*each) for each in refused] == [ERROR] * len(refused)
    assert new.get(*new.fmu.outputs) == before and new.get("time") == [1.0]
    assert new.step(1.0, 1.0) == OK and new.get("time") == [2.0]
    assert new.set("gearbox.kp", 0.02) == ERROR and new.messages[-1] == "gearbox.kp is fixed once the simulation runs"
    assert new.call("fmi3Terminate") == OK and new.set("environment.push.force.y", 1.0) == ERROR
    assert new.step(2.0, 0.04) == ERROR
    assert new.call("fmi3Reset") == OK and new.get("gearbox.kp") == [0.01]
    assert new.enter() == OK and new.leave() == OK and new.step(0.0, 0.04) == OK


def test_wrong_values_and_references_are_refused_and_change_nothing(new: Instance) -> None:
    before = new.get(*NAMES)
    for value in (math.nan, math.inf, -math.inf, -0.001):
        for name in ("gearbox.kp", "links.lower.mass"):
            assert new.set(name, value) == DISCARD
    most = " from 0 to 1.79769313486232e+308"
    assert new.messages[-2:] == [
        f"gearbox.kp cannot be -0.001, only a number{most}",
        f"links.lower.mass cannot be -0.001, only a number{most}",
    ]
    for reference in ("time", "shoulder.q", 99, 2**32 - 1):
        assert new.set(reference, 0.0) == ERROR
    assert new.messages[-4:-2] == ["time is computed and cannot be set", "shoulder.q is computed and cannot be set"]
    assert new.ask(99)[0] == ERROR and new.messages[-1] == "value reference 99: there is no such variable"
    assert new.get(*NAMES) == before
    assert new.call("fmi3GetFloat64", None, 1, None, 1) == ERROR
    assert new.call("fmi3GetFloat64", None, 0, None, 0) == OK
    assert new.call("fmi3SetInt32", None, 1, None, 1) == ERROR and new.call("fmi3SetInt32", None, 0, None, 0) == OK
    for name in ("fmi3EnterEventMode", "fmi3EnterConfigurationMode", "fmi3GetDirectionalDerivative"):
        assert new.call(name) == ERROR and new.messages[-1] == f"{name} is not for this FMU"


def test_no_instance_is_made_for_what_the_fmu_has_not(fmu: Fmu) -> None:
    for instance in (fmu.instance("another"), fmu.instance(event_mode=True)):
        assert not instance.handle and len(instance.messages) == 1
        for name in ("fmi3Reset", "fmi3Terminate", "fmi3ExitInitializationMode", "fmi3GetFloat64", "fmi3DoStep"):
            assert instance.call(name) == ERROR
        instance.free()
    assert fmu.called.fmi3GetVersion() == b"3.0"


@pytest.mark.slow
def test_a_state_leads_on_to_the_same_bits_also_as_bytes_in_another_instance(fmu: Fmu) -> None:
    first, other = fmu.instance(), fmu.instance()
    first.begin(gearbox__kp=0.03)
    times = np.arange(0.0, 2.001, 0.0371)
    first.rows(times[:20])
    state = first.state()
    data = first.as_bytes(state)
    rows = first.rows(times[19:])
    assert first.go_back(state) == OK and bits(first.rows(times[19:])) == bits(rows)
    status, read = other.from_bytes(data)
    assert status == OK and other.go_back(read) == OK and bits(other.rows(times[19:])) == bits(rows)
    assert other.get("gearbox.kp") == [0.03]
    for broken in (data[:-1], data + b"0", b"x" + data[1:], b""):
        assert other.from_bytes(broken)[0] == ERROR
    for place in np.random.default_rng(2).integers(0, 8 * len(data), 200).tolist():
        broken = bytearray(data)
        broken[place // 8] ^= 1 << place % 8
        assert other.from_bytes(bytes(broken))[0] == ERROR, place
    assert other.messages[-1] == "the bytes of the state are damaged"
    first.drop(state)
    other.drop(read)
    first.free()
    other.free()


@pytest.mark.slow
def test_a_state_of_another_fmu_is_refused(fmu: Fmu, folder: Path, tmp_path: Path) -> None:
    new, foreign = fmu.instance(), load(packed(folder, "seeded"), tmp_path).instance()
    state, before = foreign.state(), new.get(*NAMES)
    assert new.go_back(state) == ERROR and new.go_back(c_void_p()) == ERROR and new.get(*NAMES) == before
    assert new.messages == ["this is no state of this FMU"] * 2
    assert new.call("fmi3GetFMUState", byref(state)) == ERROR
    assert new.messages[-1] == "the room is no state of this FMU"
    assert new.call("fmi3SerializedFMUStateSize", state, byref(c_size_t())) == ERROR
    assert new.from_bytes(foreign.as_bytes(state))[0] == ERROR
    assert new.messages[-1] == "these bytes are not a state of this FMU"
    foreign.drop(state)


@pytest.mark.slow
def test_two_instances_in_turn_do_not_disturb_each_other(fmu: Fmu, folder: Path) -> None:
    both = [fmu.instance(), fmu.instance()]
    for case, instance in enumerate(both):
        begin_case(instance, deck(folder), case)
    times, rows = zip(*(run_rows(deck(folder), case)[:2] for case in (0, 1)), strict=True)
    for row in range(1, len(times[0])):
        for case, instance in enumerate(both):
            assert instance.step(times[0][row - 1], times[0][row] - times[0][row - 1]) == OK
            assert bits(instance.get(*fmu.outputs)) == bits(rows[case][row])


WILD = """\
#include <two_link.ic>
servo loose { model = passive;  damping = 1 N*m*s/rad; }
run wobbly like nominal {
    duration = 2 s;  remove settle;
    servos { elbow = loose; }
    initial { elbow.qd = 0.1 rad/s; }
}
sweep wild of wobbly { vary loose.damping = [1, 1e5] N*m*s/rad; }
"""


@pytest.mark.slow
def test_a_failed_case_says_when_and_goes_on_from_an_earlier_state(tmp_path: Path) -> None:
    fmu = load(packed(tmp_path, "wild", WILD), tmp_path)
    new = fmu.instance()
    new.begin(loose__damping=1e5)
    state, statuses = new.state(), [new.step(0.04 * step, 0.04) for step in range(50)]
    assert statuses == [OK] * 6 + [ERROR] * 44  # `met run` says: t = 0.28 s
    assert new.messages[0] == "the case has failed by 0.28 s: `met run` of its values says why"
    assert new.messages[-1] == "the case has failed: reset it, or set an earlier state"
    assert new.get("time") == [0.04 * 5 + 0.04]
    assert new.go_back(state) == OK and new.step(0.0, 0.04) == OK
    new.drop(state)
    assert new.call("fmi3Reset") == OK
    new.begin(loose__damping=1.0)
    assert [new.step(0.04 * step, 0.04) for step in range(50)] == [OK] * 50
    assert new.call("fmi3Reset") == OK and new.set("loose.damping", 1e5) == OK
    assert new.enter(1e3) == OK and new.leave() == OK and new.step(1e3, 2.0) == ERROR
    assert new.messages[-1] == "the case has failed by 1002 s: `met run` of its values says why"


LONG = """\
#include <two_link.ic>
run short like nominal { duration = 1 s;  remove settle; }
sweep long of short { vary reach = [1, 2] m; }
"""


@pytest.mark.slow
def test_a_case_that_fails_at_the_start_says_so_at_each_call(tmp_path: Path) -> None:
    new = load(packed(tmp_path, "long", LONG), tmp_path).instance()
    assert new.set("reach", 1e300) == OK and new.enter() == OK
    assert new.ask("shoulder.q")[0] == ERROR
    assert new.messages.pop() == "the case has failed by 0 s: `met run` of its values says why"
    assert new.leave() == ERROR
    assert new.messages == ["the case fails at the start: set other values, or reset it"]
    assert new.set("reach", 2.0) == OK and new.leave() == OK and new.step(0.0, 0.04) == OK


SANITIZED = """\
import sys
from pathlib import Path
import numpy as np
from tests.batch.fmu.master import ERROR, OK, Fmu

fmu = Fmu(Path(sys.argv[1]).read_bytes(), Path(sys.argv[2]), tuple(sys.argv[3:]))
for n in range(1000):
    new = fmu.instance()
    if n % 50 == 0:
        new.begin(gearbox__kp=0.02)
        new.rows(np.concatenate([[0.0], np.cumsum(np.random.default_rng(n).uniform(1e-4, 0.05, 40))]))
        state = new.state()
        status, again = new.from_bytes(new.as_bytes(state))
        assert status == OK and new.go_back(again) == OK and new.ask(12345)[0] == ERROR
        assert new.set("gearbox.kp", float("nan")) == ERROR
        assert new.set("environment.push.force.y", 1e308) == OK
        new.step(new.get("time")[0], 1.0)
        new.drop(state)
        new.drop(again)
        assert new.call("fmi3Reset") == OK
    new.free()
print("done")
"""


@pytest.mark.slow
@pytest.mark.parametrize("compiler", ["gcc", "clang"])
def test_sanitizers_find_nothing(folder: Path, tmp_path: Path, compiler: str) -> None:
    run_sanitized(SANITIZED, packed(folder), tmp_path, compiler)


def test_only_functions_of_fmi_are_exported(fmu: Fmu, folder: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("no nm; on Debian or Ubuntu: apt-get install binutils")
    (path,) = (folder / "unpacked" / "binaries").glob("*/*")
    done = subprocess.run(["nm", "-D", "--defined-only", path], capture_output=True, text=True, check=True)
    names = [line.split()[-1] for line in done.stdout.splitlines()]
    assert len(names) == 75 and [name for name in names if not name.startswith("fmi3")] == []
