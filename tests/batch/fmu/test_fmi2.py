"""FMUs of FMI 2.0: what differs from FMI 3.0, by ctypes."""

from __future__ import annotations

import math
from ctypes import byref, c_double, c_size_t, c_void_p, create_string_buffer
from pathlib import Path

import numpy as np
import pytest

from tests.batch.fmu.arms import deck, load, packed, run_rows, run_sanitized
from tests.batch.fmu.master import DISCARD, ERROR, OK, Fmu, Instance2

pytestmark = [pytest.mark.compiler]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("fmi2")


@pytest.fixture(scope="module")
def fmu(folder: Path) -> Fmu:
    return load(packed(folder, version=2), folder)


@pytest.mark.slow
def test_a_case_of_a_sweep_has_the_bits_of_its_run(fmu: Fmu, folder: Path) -> None:
    found, new = deck(folder), Instance2(fmu)
    times, rows, _ = run_rows(found, 2)
    for coordinate in found.cases.coordinates:
        assert new.set(coordinate.path, float(coordinate.values[2])) == OK
    assert new.set_up(0.0, 2.0) == OK
    assert new.call("fmi2EnterInitializationMode") == OK and new.call("fmi2ExitInitializationMode") == OK
    values = [new.get(*fmu.outputs)]
    for row, time in enumerate(times[1:]):
        assert new.step(times[row], time - times[row]) == OK
        values.append(new.get(*fmu.outputs))
    assert np.array(values).tobytes() == rows.tobytes()
    assert new.step(2.0, 0.04) == ERROR and new.messages == ["the step ends after the stop"]
    assert new.call("fmi2Terminate") == OK


def test_wrong_calls_are_refused(fmu: Fmu) -> None:
    new = Instance2(fmu)
    assert (fmu.called.fmi2GetVersion(), fmu.called.fmi2GetTypesPlatform()) == (b"2.0", b"default")
    assert new.step(0.0, 0.04) == ERROR and new.call("fmi2ExitInitializationMode") == ERROR
    assert new.set_up(math.nan) == ERROR and new.set_up(1.0, 0.5) == ERROR and new.set_up(1.0) == OK
    assert new.set("gearbox.kp", math.nan) == DISCARD and new.set("gearbox.kp", -1.0) == DISCARD
    assert new.set("shoulder.q", 1.0) == ERROR
    assert new.call("fmi2EnterInitializationMode") == OK and new.set_up(0.0) == ERROR
    assert new.call("fmi2ExitInitializationMode") == OK and new.step(0.0, 0.04) == ERROR and new.step(1.0, 0.04) == OK
    time = c_double()
    assert new.call("fmi2GetRealStatus", 2, byref(time)) == OK and time.value == 1.04
    assert new.call("fmi2GetRealStatus", 1, byref(time)) == ERROR
    assert new.call("fmi2CancelStep") == ERROR and new.messages[-1] == "fmi2CancelStep is not for this FMU"
    assert new.call("fmi2GetInteger", None, c_size_t(0), None) == OK
    assert new.call("fmi2SetString", None, c_size_t(1), None) == ERROR
    assert new.call("fmi2Reset") == OK and new.call("fmi2EnterInitializationMode") == OK
    for other in (Instance2(fmu, "another"), Instance2(fmu, kind=0)):
        assert not other.handle and len(other.messages) == 1 and other.call("fmi2Reset") == ERROR
        assert other.step(0.0, 0.1) == ERROR


def test_a_state_leads_back(fmu: Fmu) -> None:
    new = Instance2(fmu)
    assert new.call("fmi2EnterInitializationMode") == OK and new.call("fmi2ExitInitializationMode") == OK
    state, size = c_void_p(), c_size_t()
    assert new.step(0.0, 0.5) == OK and new.call("fmi2GetFMUstate", byref(state)) == OK
    assert new.step(0.5, 0.5) == OK
    after = new.get(*fmu.outputs)
    assert new.call("fmi2SerializedFMUstateSize", state, byref(size)) == OK
    data = create_string_buffer(size.value)
    assert new.call("fmi2SerializeFMUstate", state, data, size) == OK
    assert new.call("fmi2FreeFMUstate", byref(state)) == OK and not state
    assert new.call("fmi2DeSerializeFMUstate", data, size, byref(state)) == OK
    assert new.call("fmi2DeSerializeFMUstate", data, c_size_t(9), byref(c_void_p())) == ERROR
    assert new.call("fmi2SetFMUstate", state) == OK and new.step(0.5, 0.5) == OK and new.get(*fmu.outputs) == after
    assert new.call("fmi2FreeFMUstate", byref(state)) == OK


def test_a_state_has_the_times_of_the_experiment(fmu: Fmu) -> None:
    new, state = Instance2(fmu), c_void_p()
    assert new.set_up(1.0, 1.1) == OK and new.call("fmi2GetFMUstate", byref(state)) == OK
    assert new.call("fmi2Reset") == OK and new.call("fmi2SetFMUstate", state) == OK
    assert new.call("fmi2EnterInitializationMode") == OK and new.call("fmi2ExitInitializationMode") == OK
    assert new.step(0.0, 0.04) == ERROR and new.step(1.0, 0.04) == OK and new.step(1.04, 0.08) == ERROR
    assert new.messages[-1] == "the step ends after the stop"
    assert new.call("fmi2FreeFMUstate", byref(state)) == OK


SANITIZED = """\
import sys
from pathlib import Path
from tests.batch.fmu.master import OK, Fmu, Instance2
from tests.batch.fmu.test_fmi2 import test_a_state_leads_back, test_wrong_calls_are_refused

fmu = Fmu(Path(sys.argv[1]).read_bytes(), Path(sys.argv[2]), tuple(sys.argv[3:]))
for n in range(1000):
    new = Instance2(fmu)
    assert new.set_up() == OK
    new.fmu.called.fmi2FreeInstance(new.handle)
for _ in range(5):
    test_wrong_calls_are_refused(fmu)
    test_a_state_leads_back(fmu)
print("done")
"""


@pytest.mark.slow
def test_sanitizers_find_nothing(folder: Path, tmp_path: Path) -> None:
    run_sanitized(SANITIZED, packed(folder, version=2), tmp_path, "gcc")
