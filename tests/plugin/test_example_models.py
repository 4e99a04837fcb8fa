"""The example package does what docs/models.md says, and the page shows the package's files as they are."""

from __future__ import annotations

import importlib
import re
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from met import models
from met import run as engine
from met.diagnostic import Problem
from met.servos.servo import JointMotion, Seen, Setpoint
from met.trace import Formulas, Graph
from tests.ic.small_decks import check, experiment, messages

HERE = Path(__file__).parent
PAGE = (HERE.parents[1] / "docs" / "models.md").read_text(encoding="utf-8")

SERVO = SimpleNamespace(gain=np.float64(200.0), limit=np.float64(30.0), lag=np.float64(0.01), rotor=np.float64(2.0))
WIND = SimpleNamespace(
    link="upper", velocity=(3.0, 0.0, 4.0), point=(1.0, 0.0, 0.0), area=np.float64(0.5), density=np.float64(1.2)
)


@pytest.fixture(autouse=True)
def package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(HERE))


def load(name: str):  # type: ignore[no-untyped-def]
    return importlib.import_module(f"met_example_models.{name}")


class Still:
    """A world whose links do not move, or all move alike."""

    def __init__(self, velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        self.moving = velocity

    def velocity(self, link: str, point: tuple[float, float, float]) -> tuple[float, float, float]:
        return self.moving


def test_the_servos_computer_hands_the_rate_on() -> None:
    seen = Seen(q=0.0, qd=0.1, setpoint=Setpoint("rate", np.float64(0.4), np.float64(0.0)), period=0.001)
    assert load("velocity_servo").control(SERVO, SimpleNamespace(), seen).outputs == {"qd_cmd": 0.4}


def test_the_torque_goes_to_the_gain_times_the_rate_error_until_the_limit() -> None:
    drive = load("velocity_servo").drive
    held, states = SimpleNamespace(qd_cmd=np.float64(0.4)), SimpleNamespace(torque=np.float64(5.0))
    small = drive(SERVO, held, states, JointMotion(q=0.0, qd=np.float64(0.3), time=0.0))
    assert small.torque == 5.0
    assert small.signals["wanted"] == pytest.approx(20.0, rel=1e-15)  # 200 * 0.1: two roundings
    assert small.slopes["torque"] == pytest.approx(1500.0, rel=1e-14)  # (20 - 5)/0.01: the difference loses a digit
    large = drive(SERVO, held, states, JointMotion(q=0.0, qd=np.float64(-10.0), time=0.0))
    assert large.signals["wanted"] == 30.0


def test_no_joint_under_the_servo_is_faster_than_it_says() -> None:
    bound = load("velocity_servo").fastest(SERVO)
    for inertia in (2.0, 2.5, 10.0, 1e3):
        roots = np.roots([SERVO.lag * inertia, inertia, SERVO.gain])
        assert max(abs(roots)) <= bound * (1.0 + 1e-12)  # roots are found to rounding, and one may lie on the bound


def test_wind_pushes_a_link_at_rest_along_the_wind() -> None:
    (force,) = load("wind").loads(WIND, Still()).forces
    # 1/2 * 1.2 * 0.5 * 5^2 = 7.5 N along (0.6, 0, 0.8); a few roundings
    assert force.force == pytest.approx((4.5, 0.0, 6.0), rel=1e-15)
    assert (force.link, force.point) == ("upper", (1.0, 0.0, 0.0))


def test_wind_does_nothing_to_what_moves_with_it() -> None:
    (force,) = load("wind").loads(WIND, Still(WIND.velocity)).forces
    assert force.force == (0.0, 0.0, 0.0)


def test_the_slope_of_the_approach_is_its_derivative() -> None:
    p, t, d = SimpleNamespace(to=0.3, time=0.5), 0.2, 1e-5
    course = load("approach").course
    difference = (course(p, t + d)[0] - course(p, t - d)[0]) / (2 * d)
    assert course(p, t)[1] == pytest.approx(difference, rel=1e-9)  # d^2/6 of the third derivative is 7e-11
    assert course(p, 0.0)[0] == 0.0


def gathered(xs: list[float], dt: float) -> float:
    mean = load("mean")
    held = {memory.name: memory.start for memory in mean.METRIC.memory}
    for k, x in enumerate(xs):
        held = mean.update(None, SimpleNamespace(**held), x, k * dt, dt if k else 0.0)
    return float(mean.result(None, SimpleNamespace(**held), (len(xs) - 1) * dt))


def test_the_mean_is_the_trapezoids() -> None:
    assert gathered([0.0, 1.0, 1.0], 0.5) == 0.75
    assert gathered([3.0], 0.5) == 3.0


@pytest.mark.parametrize("name", ["velocity_servo", "wind", "approach", "mean"])
def test_recorded_the_models_compute_the_same_as_with_plain_numbers(name: str) -> None:
    graph = Graph()
    numbers = {"x": 0.37, "y": -0.21, "z": 1.4}
    x, y, z = (graph.input(each) for each in numbers)

    def outcome(x, y, z):  # type: ignore[no-untyped-def]
        model = load(name)
        if name == "velocity_servo":
            states, joint = SimpleNamespace(torque=y), JointMotion(q=0.0, qd=z, time=0.0)
            found = model.drive(SERVO, SimpleNamespace(qd_cmd=x), states, joint)
            return [found.torque, found.slopes["torque"], found.signals["wanted"], model.fastest(SERVO) + x]
        if name == "wind":
            return list(model.loads(WIND, Still((x, y, z))).forces[0].force)
        if name == "approach":
            return list(model.course(SimpleNamespace(to=x, time=z), z))
        new = model.update(None, SimpleNamespace(area=x, last=y, until=z), z, z, 0.1)
        return [*new.values(), model.result(None, SimpleNamespace(area=x, last=y, until=z), z)]

    recorded = Formulas.of(graph, outcome(x, y, z)).replay(numbers)
    plain = outcome(*map(np.float64, numbers.values()))
    # exp is expanded into primitives when it is recorded: some units in the last place; all else is the same
    assert [float(value) for value in recorded] == pytest.approx([float(value) for value in plain], rel=1e-15)


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """The package as an installer would leave it: its entry points where Python looks for them."""
    project = tomllib.loads((HERE / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    info = tmp_path / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    lines = []
    for group, points in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in points.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    models.available.cache_clear()
    yield
    models.available.cache_clear()


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("servo", "velocity_servo"), ("servo", "belt_drive"), ("environment", "wind"), ("command", "approach"),
        ("metric", "mean"),
    ],
)  # fmt: skip
def test_an_installed_package_offers_its_models_by_name(installed: None, kind: models.Kind, name: str) -> None:
    assert models.find(kind, name).name == name


BELT = """\
arm crane {
    link boom { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = boom; axis = z; }
}
servo winch {
    model = belt_drive; kp = 4 N*m*s/rad; ki = 8 N*m/rad; limit = 3 N*m; rotor = 0.5 kg*m^2; stiffness = 900 N*m/rad;
    damping = 9 N*m*s/rad; command = rate(0.5 rad/s);
}
run lift {
    arm = crane; servos { hinge = winch; } environment {} initial { hinge.q = 1 rad; hinge.qd = 0.2 rad/s; }
    rates { dynamics = 2 kHz; servos = 500 Hz; record = 500 Hz; } duration = 6 s;
    record = [q, qd, servo.angle, servo.torque_cmd, servo.integral];
}
run smooth like lift { rates { servos = continuous; } }
run away like lift { environment { fault = runaway { joint = hinge; from = 5 s; } } }
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lift", "smooth", "away"])
def test_the_belt_drives_integral_begin_and_full_do_what_the_page_says(
    installed: None, name: str, tmp_path: Path
) -> None:
    signals = engine.run(experiment(tmp_path, BELT, select=[name])).signals
    q, qd, angle = (signals[each][0, :, 0] for each in ("q", "qd", "servo.angle"))
    torque = signals["servo.torque_cmd"][0, :, 0]
    assert angle[0] == q[0] == 1.0, "`begin`: the belt is slack"
    if name == "away":
        assert (torque[2510:] == 3.0).all(), "`full`"
        return
    # the slow pole of 1.17 s^2 + 4 s + 8 decays by exp(-1.7 t): to 4e-5 of the step of 0.3 rad/s in 6 s
    assert abs(qd[-1] - 0.5) < 1e-4
    assert abs(torque[-1]) < 1e-3 and abs(signals["servo.integral"][0, -1, 0]) < 1e-3


def test_a_servo_of_ones_own_without_full_is_told_what_to_declare(
    installed: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    bare = replace(models.find("servo", "belt_drive"), full=None)
    monkeypatch.setitem(models.available("servo"), "belt_drive", bare)
    said = messages(check(tmp_path, BELT, select=["away"]))
    assert "D247" in said
    assert "= help: declare `full` in the model `belt_drive`: the law's outputs at full drive" in said


def test_a_misspelt_state_with_friction_is_told_with_those_there_are(
    installed: None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = models.find("servo", "belt_drive")
    rubbing = replace(model, drive=lambda *given: replace(model.drive(*given), friction={"rat": 0.1}))
    monkeypatch.setitem(models.available("servo"), "belt_drive", rubbing)
    with pytest.raises(Problem) as caught:
        engine.run(experiment(tmp_path, BELT, select=["lift"]))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "E212"
    assert diagnostic.message.endswith("friction gave back rat; declared are angle, rate")
    assert diagnostic.help == ("did you mean `rate`?", "give back declared names alone")


def test_without_the_package_the_name_is_unknown() -> None:
    models.available.cache_clear()
    with pytest.raises(Problem, match="D140: no servo model `velocity_servo`"):
        models.find("servo", "velocity_servo")


def test_a_branch_on_a_recorded_value_is_refused_at_its_line() -> None:
    def course(p: object, t):  # type: ignore[no-untyped-def]
        return (1.0 if t > 1.0 else 0.0), 0.0

    with pytest.raises(Problem) as caught:
        course(None, Graph().input("t"))
    (diagnostic,) = caught.value.diagnostics
    assert diagnostic.code == "E200"
    assert diagnostic.at is not None
    assert diagnostic.at.place.file == __file__
    assert "where(condition, a, b)" in " ".join(diagnostic.help)


@pytest.mark.parametrize("name", ["velocity_servo", "belt_drive", "wind", "approach", "mean"])
def test_the_page_shows_the_file_as_it_is(name: str) -> None:
    blocks = re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL)
    assert (HERE / "met_example_models" / f"{name}.py").read_text(encoding="utf-8") in blocks
