"""Linear answers in xarray, as systems of python-control, and in files: the same numbers with names."""

from __future__ import annotations

import csv
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import batch
import ic
from batch.linearized import LinearAnswer, picture
from met.diagnostic import Problem

DECK = """\
#include <servos/rigid_gearbox.ic>
arm swing {
    link bar { mass = 2 kg;  shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base;  child = bar;  axis = z; }
}
servo drive like rigid_gearbox { command = rate(0.1 rad/s); }
run hold {
    arm = swing;  servos { hinge = drive; }  rates { dynamics = 1 kHz;  servos = 500 Hz; }
    initial { hinge.qd = 0.1 rad/s; }  duration = 1 s;  record = [q];
}
"""


@pytest.fixture
def answer() -> LinearAnswer:
    return batch.linear(
        ic.compile(text=DECK),
        at=0.5,
        inputs=["hinge.servo.command", "hinge.servo.voltage"],
        outputs=["q", "hinge.tau"],
        opened=["hinge.servo.voltage"],
    )


def test_the_dataset_has_the_matrices_with_names(answer: LinearAnswer) -> None:
    data = answer.data
    assert data.A.sel(state="hinge.q", from_state="hinge.q") == 1.0
    assert data.A.dims == ("state", "from_state") and data.C.dims == ("output", "from_state")
    assert data.input.values.tolist() == ["hinge.servo.command", "hinge.servo.voltage"]
    assert data.output.values.tolist() == ["hinge.q", "hinge.tau"]
    np.testing.assert_array_equal(data.C.sel(output="hinge.q"), [1.0, 0.0, 0.0])
    assert data.attrs["period"] == 0.002 and data.attrs["time"] == 0.5
    np.testing.assert_allclose(data.share.sum("state"), 1.0)
    assert data.plant_B.sel(plant_state="hinge.qd", held="hinge.servo.voltage") > 0.0
    np.testing.assert_array_equal(data.plant_A.sel(plant_state="hinge.q"), [0.0, 1.0])


@pytest.mark.slow
def test_a_step_of_the_system_is_the_step_of_the_run(answer: LinearAnswer, tmp_path: Path) -> None:
    """The linear answer to a moved command is that of two runs; the arm without gravity and friction's change is
    linear, so they agree to rounding."""
    found = answer.found
    x = np.zeros(len(found.states))
    for _ in range(100):
        x = found.A @ x + found.B[:, 0] * 0.001
    ends = []
    for rate in ("0.1 rad/s", "0.101 rad/s"):
        moved = f"rate(step(start = 0.1 rad/s, at = 0.5 s, to = {rate}))"
        archive = batch.run(
            ic.compile(text=DECK.replace("rate(0.1 rad/s)", moved)), output=tmp_path / f"{len(ends)}.h5", verify="none"
        )
        ends.append(float(archive.open().q.isel(recorded_case=0, joint=0).sel(time=0.7, method="nearest")))
    assert found.states[0] == "hinge.q"
    assert ends[1] - ends[0] == pytest.approx(x[0], rel=1e-9)


def test_a_file_of_each_kind_has_the_same_numbers(answer: LinearAnswer, tmp_path: Path) -> None:
    import xarray

    found = answer.found
    for name in ("a.npz", "a.h5", "a.csv"):
        answer.write(tmp_path / name)
    arrays = np.load(tmp_path / "a.npz")
    np.testing.assert_array_equal(arrays["A"], found.A)
    assert arrays["state"].tolist() == list(found.states) and float(arrays["period"]) == found.seconds
    with xarray.open_dataset(tmp_path / "a.h5", engine="h5netcdf") as data:
        np.testing.assert_array_equal(data.B.values, found.B)
        assert data.B.dims == ("state", "input") and data.attrs["experiment"] == "hold"
    rows = list(csv.reader((tmp_path / "a.csv").read_text().splitlines()))
    first = next(k for k, row in enumerate(rows) if row[0] == "C")
    assert rows[first] == ["C", *found.states]
    assert [float(cell) for cell in rows[first + 1][1:]] == found.C[0].tolist() and rows[first + 1][0] == "hinge.q"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("a.txt", "are .npz, .h5 or .csv files"),
        ("no/a.npz", "does not exist"),
        ("there.csv", "there.csv exists: it is not written over"),
    ],
)
def test_a_place_that_is_none_is_refused(name: str, message: str, answer: LinearAnswer, tmp_path: Path) -> None:
    (tmp_path / "there.csv").write_text("mine")
    with pytest.raises(Problem, match=message):
        answer.write(tmp_path / name)
    assert (tmp_path / "there.csv").read_text() == "mine"


@pytest.mark.oracle
def test_the_system_of_python_control_is_the_same(answer: LinearAnswer) -> None:
    pytest.importorskip("control")
    system = answer.state_space()
    assert system.dt == 0.002 and system.state_labels == ["hinge_q", "hinge_qd", "hinge_servo_integral"]
    assert system.input_labels == ["hinge_servo_command", "hinge_servo_voltage"]
    loop = answer.found.loops[0].loop
    assert loop is not None
    z = np.exp(1j * 3.0 * 0.002)
    own = answer.found.C[0] @ np.linalg.solve(z * np.eye(3) - answer.found.A, answer.found.B[:, 0])
    np.testing.assert_allclose(system(z)[0, 0], own, rtol=1e-10)


def test_without_python_control_that_is_said(answer: LinearAnswer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "control", None)
    with pytest.raises(Problem) as refused:
        answer.state_space()
    (told,) = refused.value.diagnostics
    assert told.code == "E451" and told.message == "a `control.StateSpace` needs the package python-control"
    assert told.help == ("`pip install control`, or what MET's extra `control` names",)


@pytest.mark.release
def test_a_picture_is_drawn_alike_each_time(answer: LinearAnswer, tmp_path: Path) -> None:
    for name in ("a.png", "b.png", "a.svg"):
        answer.draw(tmp_path / name)
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()
    assert (tmp_path / "a.svg").stat().st_size > 10_000


def marks(axis: Any) -> list[float]:
    """The marks of an axis that are in view."""
    low, high = sorted(axis.get_view_interval())
    return [float(each) for each in axis.get_majorticklocs() if low <= each <= high]


@pytest.mark.slow
def test_a_picture_has_a_mark_of_phase_every_45_degrees(answer: LinearAnswer) -> None:
    _, phase, nichols, *_ = picture.figure(answer.found).axes
    assert marks(phase.yaxis) == [-180.0, -135.0, -90.0, -45.0]
    assert set(marks(nichols.xaxis)) >= {-180.0, -135.0, -90.0}


@pytest.mark.slow
@pytest.mark.parametrize("times", [0.001, 1.0, 1000.0])
def test_phases_have_several_marks_however_little_a_loop_turns(answer: LinearAnswer, times: float) -> None:
    """A double integral whose phase is -180 deg nearly everywhere, at several gains."""
    found = answer.found
    one = np.array([[1.0, found.seconds], [0.0, 1.0]])
    (loop,) = found.loops
    assert loop.loop is not None
    flat = replace(loop.loop, A=one, B=np.array([0.0, -times]), C=np.array([1.0, 0.5 * found.seconds]), D=0.0)
    made = replace(found, inputs=(), loops=(replace(loop, loop=flat, margins=None),))
    _, phase, nichols = picture.figure(made).axes
    for axis in (phase.yaxis, nichols.xaxis):
        assert 2 <= len(marks(axis)) <= 9 and -180.0 in marks(axis)
