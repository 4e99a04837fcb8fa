"""What the other cases of a block ask for changes nothing: a case has its bits even if all is always asked for.

Control runs a loop's body for a whole block as soon as one case asks. The worst company there can be asks every time,
as often as the loop allows; so the plain run is held against one in which every loop takes all its turns.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import met.servos
from met import models
from met import run as engine
from met.backends.reference.plain import execute
from met.parameter import Memory, Parameter
from met.plan import Experiment
from met.program import build
from met.servos import Servo
from met.servos.servo import Control as Law
from met.servos.servo import Drive
from met.trace import maximum, sin, where
from met.trace.program import Control, Every, Unless0, WhileAny
from tests.ic.small_decks import changed, experiment


def always(body: tuple[Control, ...]) -> tuple[Control, ...]:
    """The control with every loop written out, as often as it may go round, whether it is asked for or not."""
    parts: list[Control] = []
    for node in body:
        if isinstance(node, WhileAny):
            parts += always(node.body) * node.at_most
        else:
            parts.append(replace(node, body=always(node.body)) if isinstance(node, (Every, Unless0)) else node)
    return tuple(parts)


def differing(made: Experiment, case: int) -> tuple[int, dict[str, float]]:
    """Numbers of a case that differ when everything is asked for, and its outputs."""
    program, ticks = build(made), made.structure.schedule.ticks
    inputs = engine.inputs(made, np.array([case]))[0]
    rows, outputs = execute(program, inputs, ticks)
    again, besides = execute(replace(program, tick=always(program.tick)), inputs, ticks)
    assert np.isfinite(rows).all()
    return int((rows != again).sum()) + sum(besides[name] != outputs[name] for name in outputs), outputs


BRAKE = Servo(
    name="brake",
    doc="A servo of this test: friction whose level comes and goes, of its computer or of nature.",
    parameters=(
        Parameter(name="by", shape="word", words=("computer", "time", "nobody"), doc="who changes the level"),
        Parameter(name="level", unit="effort", doc="largest level of friction"),
        Parameter(name="push", unit="effort", doc="largest torque"),
        Parameter(name="begin", unit="s", doc="when its computer brakes"),
    ),
    outputs=(Memory(name="braking", unit="1", doc="1 while it brakes"),),
    control=lambda p, held, seen: Law({"braking": where(seen.time >= p.begin, 1.0, 0.0)}),
    drive=lambda p, held, states, joint: Drive(
        torque=p.push * sin(31.0 * joint.time),
        dry=p.level * {"computer": held.braking, "time": maximum(0.0, sin(97.0 * joint.time)), "nobody": 1.0}[p.by],
        rotor=0.1,
    ),
)
ARM = """\
arm swing {
    link bar { mass = 1 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
}
"""
TIP = """\
    link top { mass = 0.5 kg; shape = rod(length = 0.5 m, along = x); }
    joint tip revolute { parent = bar; child = top; axis = z; at = [1, 0, 0] m; }
}
"""
RUN = """\
servo hold { model = brake; by = computer; level = 3 N*m; push = 0 N*m; begin = 15 ms; }
run it {
    arm = swing;  servos { hinge = hold; }
    rates { base = 1 kHz; dynamics = 100 Hz; servos = 1 kHz; record = 100 Hz; }
    integrator = modified_euler;  duration = 0.2 s;  record = [q, qd];
}
sweep both_ways of it { vary initial.hinge.qd = [1, -1] rad/s; }
"""


@pytest.fixture
def brake(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(met.servos, "SERVOS", (*met.servos.SERVOS, BRAKE))
    models.available.cache_clear()
    yield
    models.available.cache_clear()


@pytest.mark.slow
@pytest.mark.usefixtures("brake")
@pytest.mark.parametrize("integrator", ["modified_euler", "midpoint", "rk4"])
def test_friction_that_begins_within_a_step_opposes_motion_either_way(tmp_path: Path, integrator: str) -> None:
    run = engine.run(experiment(tmp_path, ARM, changed(RUN, ("modified_euler", integrator)), select=["both_ways"]))
    forward, backward = run.signals["qd"][:, :, 0]
    assert (backward == -forward).all(), "as in a mirror, to the bit"
    assert (np.diff(forward) <= 0.0).all() and forward[0] == 1.0 and forward[-1] == 0.0


@pytest.mark.release
@pytest.mark.usefixtures("brake")
@pytest.mark.parametrize("integrator", ["modified_euler", "semi_implicit_euler", "rk4"])
def test_company_changes_nothing_where_joints_stick_and_levels_come_and_go(tmp_path: Path, integrator: str) -> None:
    run = changed(
        RUN,
        ("by = computer", "by = time"),
        ("push = 0", "push = 20"),
        ("duration = 0.2", "duration = 1"),
        ("hinge = hold;", "hinge = hold; tip = hold { by = nobody; level = 1 N*m; push = -3 N*m; };"),
        ("modified_euler", integrator),
        ("servos = 1 kHz", "servos = 500 Hz"),
    )
    made = experiment(tmp_path, ARM.removesuffix("}\n") + TIP, run, select=["both_ways"])
    count, outputs = differing(made, 0)
    assert count == 0 and outputs["friction.splits"] > 5.0, outputs
