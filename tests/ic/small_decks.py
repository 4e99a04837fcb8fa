"""A small deck in parts, for tests that change one of them."""

from __future__ import annotations

from pathlib import Path

import ic
from ic.driver.compile import Compiled, Select
from met.messages.render import render
from met.plan import Experiment

ARM = """\
arm swing {
    link bar { mass = 2 kg; shape = rod(length = 1 m, along = x); }
    joint hinge revolute { parent = base; child = bar; axis = z; }
}
"""
LIGHT = ARM.replace("shape = rod(length = 1 m, along = x)", "com = [0, 0, 0] m; inertia = [1e-9, 1e-9, 1e-9] kg*m^2")
"""The same arm with a bar that hardly adds to the inertia of a servo's rotor."""

SERVO = """\
servo drive {
    model = rigid_gearbox;
    ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; resistance = 1 ohm; kt = 0.05 N*m/A;
    tau_max = 1 N*m; j_m = 1e-4 kg*m^2;
    command = rate(0.1 rad/s);
}
"""
RUN = """\
run hold {
    arm = swing;
    servos { hinge = drive; }
    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }
    duration = 1 s;
    record = [q];
}
"""


def check(folder: Path, *parts: str, select: Select = None, **options: object) -> Compiled:
    """The deck made of the parts, or of the small one where there are none, compiled."""
    path = folder / "deck.ic"
    path.write_text("".join(parts or (ARM, SERVO, RUN)), encoding="utf-8")
    return ic.check(path, select=select, **options)  # type: ignore[arg-type]


def experiment(folder: Path, *parts: str, select: Select = None) -> Experiment:
    """The one experiment of a deck that must compile."""
    compiled = check(folder, *parts, select=select)
    assert compiled.plan is not None, messages(compiled)
    (only,) = compiled.plan.experiments
    return only


def messages(compiled: Compiled) -> str:
    """What was said, as a terminal without colours shows it; places by the file's name alone."""
    text = render(compiled.diagnostics, compiled.sources)
    for name in compiled.sources:
        text = text.replace(name, Path(name).name)
    return text


def shown(folder: Path, *parts: str, select: Select = "all") -> str:
    """What was said of a deck, as of `messages`, without the counting line."""
    return messages(check(folder, *parts, select=select)).rpartition("\n\n")[0] + "\n"


def codes(folder: Path, *parts: str, select: Select = None) -> list[str]:
    """Codes of what was said, in order."""
    return [diagnostic.code for diagnostic in check(folder, *parts, select=select).diagnostics]


def changed(part: str, *changes: tuple[str, str]) -> str:
    """The part with pieces of its text replaced; each must be there."""
    for old, new in changes:
        assert old in part, old
        part = part.replace(old, new, 1)
    return part
