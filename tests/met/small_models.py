"""The smallest deck that uses a model, of any kind, with any values: written from the model's declaration.

A model that is added gets a line in `SMALLEST`, which says what its declaration cannot: numbers that suit the arm of
this deck. All else (units, which joint, where in a deck the model stands) follows from the declaration, so that the
tests of tests/met/declarations exercise every parameter of every model, and tests/met/test_every_model.py runs each.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, get_args

from met import models
from met.frozen import frozen
from met.parameter import Parameter, under
from met.plan import JointKind
from met.units import PURE, Dimension, parse_unit

KINDS: tuple[models.Kind, ...] = get_args(models.Kind)
EVERY = [(kind, name) for kind in KINDS for name in models.find_own(kind)]

JOINTS: dict[str, JointKind] = {"hinge": "revolute", "slide": "prismatic"}
"""The joints of the deck's arm, and their kinds."""

CASES = "vary initial.hinge.q = linspace(-1, 1, 7) rad;"
TIMES = (0.0, 0.1, 0.2)

DECK = """\
arm small {{
    link bar {{ mass = 2 kg; shape = rod(length = 1 m, along = x); }}
    link tip {{ mass = 1 kg; shape = sphere(radius = 0.1 m); com = [0.2, 0.1, 0] m; }}
    joint hinge revolute  {{ parent = base; child = bar; axis = y; }}
    joint slide prismatic {{ parent = bar;  child = tip; axis = x; at = [1, 0, 0] m; }}
}}
{more}
run it {{
    arm         = small;
    servos      {{ {servos} }}
    environment {{ {gravity}  {environment} }}
    rates       {{ base = 1 kHz;  dynamics = 250 Hz;  servos = 500 Hz;  record = 125 Hz; }}
    integrator  = {integrator};
    duration    = 0.2 s;
    record      = [q, qd, qdd, tau];
    metric m    = {metric};
    {run}
}}
sweep cases of it {{ {cases} }}
"""
PLAIN = {
    "more": "", "servos": "", "gravity": "gravity = [0, 0, -9.81] m/s^2;", "environment": "",
    "integrator": "modified_euler", "metric": "final { of = slide.q; }", "run": "", "cases": CASES,
}  # fmt: skip
"""The parts of the deck, where no model writes them."""

Value = float | str | tuple[float, ...]


@frozen
class Small:
    """What the smallest deck that uses a model says of it.

    values   by parameter, in SI: what must be written, and what makes the model act
    command  kind of command, of a servo or in which a profile stands; none: the servo's first, or a rate
    of       what of a joint a metric watches
    beside   further text for parts of the deck (`PLAIN`), as a model needs that acts on what another one does
    """

    values: Mapping[str, Value] = field(default_factory=dict)
    command: str = ""
    of: str = "qd"
    beside: Mapping[str, str] = field(default_factory=dict)


SMALLEST: dict[tuple[str, str], Small] = {
    ("servo", "rigid_gearbox"): Small({
        "ratio": 100.0, "kp": 0.1, "ki": 1.0, "v_max": 24.0, "resistance": 1.0, "kt": 0.05, "tau_max": 1.0,
        "j_m": 1e-4, "f_c": 0.005, "k_position": 5.0,
    }),
    ("servo", "ideal"): Small({"bandwidth": 30.0}),
    ("servo", "passive"): Small({"friction": 1.0}),
    ("servo", "locked"): Small({"release": 0.1}),
    ("environment", "gravity"): Small({"g": (0.0, 0.0, -9.81)}, beside={"gravity": ""}),
    ("environment", "joint_damping"): Small({"damping": 1.0}),
    ("environment", "wrench"): Small({"link": "tip", "force": (1.0, 2.0, 3.0), "until": 0.1}),
    ("command", "constant"): Small({"value": 0.5}),
    ("command", "step"): Small({"to": 0.5, "at": 0.1}),
    ("command", "ramp"): Small({"to": 0.5, "over": 0.1}),
    ("command", "sine"): Small({"amplitude": 0.5, "frequency": 3.0}),
    ("command", "table"): Small({"times": (0.0, 0.1), "values": (0.0, 0.5)}),
    ("command", "chirp"): Small({"amplitude": 0.5, "f0": 1.0, "f1": 9.0, "over": 0.2}),
    ("command", "trapezoid"): Small({"to": 0.5, "max_rate": 9.0, "max_acceleration": 300.0}),
    ("command", "trajectory"): Small({"file": "moves.csv"}),
    ("metric", "final"): Small(of="q"),
    ("metric", "max"): Small(),
    ("metric", "min"): Small(of="qdd"),
    ("metric", "overshoot"): Small({"target": 0.1}, of="q"),
    ("metric", "rms"): Small(),
    ("metric", "settling_time"): Small({"target": 0.1, "within": 0.05}, of="q"),
    **{("integrator", name): Small() for name in models.find_own("integrator")},
    **{(kind, name): Small() for kind in ("bed", "law") for name in models.find_own(kind)},
}  # fmt: skip


@frozen
class Use:
    """A model in the small deck.

    joint    the joint that it is on, or whose channel a metric watches
    command  kind of the joint's command; "" where the model has to do with none
    carrier  of a command, bed or law: the servo that it stands in; "" for the first that takes it
    words    words that it writes, by parameter, in the stead of the smallest deck's
    """

    kind: models.Kind
    name: str
    joint: str = "hinge"
    command: str = ""
    carrier: str = ""
    words: Mapping[str, str] = field(default_factory=dict)

    @property
    def model(self) -> Any:
        return models.find(self.kind, self.name)

    @property
    def small(self) -> Small:
        return SMALLEST[self.kind, self.name]

    @property
    def head(self) -> str:
        """What the paths of its parameters begin with."""
        return {
            "servo": f"{self.joint}.servo", "command": f"{self.joint}.servo.command", "environment": "environment.used",
            "metric": "metrics.m", "bed": f"{self.joint}.bed", "law": f"{self.joint}.law", "integrator": "integrator",
        }[self.kind]  # fmt: skip

    @property
    def label(self) -> str:
        """What messages call it."""
        return {
            "servo": "servo `used`", "command": f"`{self.name}`", "environment": "environment `used`",
            "metric": "metric `m`", "bed": f"bed `{self.name}` of joint `{self.joint}`",
            "law": f"law `{self.name}` of joint `{self.joint}`", "integrator": "",
        }[self.kind]  # fmt: skip

    @property
    def values(self) -> dict[str, Value]:
        """What the smallest deck writes, in SI, by parameter; of those that are there."""
        known = [parameter.name for parameter in self.parameters()]
        return {name: value for name, value in {**self.small.values, **self.words}.items() if name in known}

    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters that a deck may write here, with the bounds that hold here.

        All that the model has: the one place to leave out what is there under some words (`words`) or commands alone.
        """
        return tuple(under(parameter, self.command) for parameter in models.written(self.model))

    def in_plan(self) -> tuple[Parameter, ...]:
        """The parameters that a plan holds of it, which the model's functions read; likewise."""
        declared = getattr(self.model, "parameters", ())
        return tuple(under(parameter, self.command) for parameter in declared if parameter.shape != "text")

    def parameter(self, name: str) -> Parameter:
        return next(parameter for parameter in self.parameters() if parameter.name == name)

    def needed(self, parameter: Parameter) -> bool:
        """Whether a deck must write it here."""
        defaulted = parameter.default is not None or bool(parameter.of_servo)
        return not defaulted or self.command in parameter.needed_for

    def unit(self, parameter: Parameter) -> str:
        """Its SI unit here, as a deck writes it; "" for a pure number."""
        words = WORDS[JOINTS[self.joint]]
        of = in_words(WATCHED[self.small.of], words)
        asked = in_words(ASKED[self.command], words) if self.command else ""
        text = in_words(parameter.unit, {**words, "command": asked, "of": of})
        return "" if parse_unit(text).dimension == PURE else text

    def dimension(self, parameter: Parameter) -> Dimension:
        return parse_unit(self.unit(parameter) or "1").dimension

    def text(self, parameter: Parameter, value: Value) -> str:
        """A value in SI as a deck writes it."""
        if isinstance(value, str):
            return f'"{value}"' if parameter.shape == "text" else value
        unit = self.unit(parameter)
        number = f"[{', '.join(map(repr, value))}]" if isinstance(value, tuple) else repr(float(value))
        return f"{number} {unit}".rstrip()

    def deck(self, written: Mapping[str, str] | None = None, *, without: Collection[str] = (), before: str = "",
             cases: str = CASES) -> str:  # fmt: skip
        """The deck.

        written  texts of parameters, in the stead of the smallest deck's or besides
        without  parameters that are left out
        before   what stands before all else;  cases: the body of its sweep
        """
        entries = {name: self.text(self.parameter(name), value) for name, value in self.values.items()}
        entries |= written or {}
        parts = {**PLAIN, **self.small.beside, "cases": cases}
        own = self._parts({name: text for name, text in entries.items() if name not in without})
        return before + DECK.format(**parts | {name: f"{parts[name]} {text}" if name not in ("integrator", "metric")
                                               else text for name, text in own.items()})  # fmt: skip

    def _parts(self, entries: Mapping[str, str]) -> dict[str, str]:
        """The parts of the deck in which it stands, with its entries."""
        block = f"{{ {' '.join(f'{name} = {text};' for name, text in entries.items())} }}"
        call = f"({', '.join(f'{name} = {text}' for name, text in entries.items())})" if entries else ""
        if self.kind == "servo":
            asked = f"command = {self.command}({value_of(self.command, self.joint)});" if self.command else ""
            definition = f"servo used {{ model = {self.name}; {block[2:-2]} {asked} }}"
            return {"more": definition, "servos": f"{self.joint} = used;"}
        if self.kind in ("command", "bed", "law"):
            asked = f"{self.name}{call}" if self.kind == "command" else value_of(self.command, self.joint)
            servo = replace(self, kind="servo", name=self.carrier or carrier(self.kind, self.command), words={})
            taken = servo._parts({name: servo.text(servo.parameter(name), value)
                                  for name, value in servo.values.items()})  # fmt: skip
            taken["servos"] = f"{self.joint} = used {{ command = {self.command}({asked}); }};"
            put = f"substitute {self.joint} {{ {self.kind} = {self.name}{call}; }}"
            return taken if self.kind == "command" else {**taken, "run": put}
        if self.kind == "environment":
            return {"environment": f"used = {self.name} {block};"}
        if self.kind == "metric":
            return {"metric": f"{self.name} {{ of = {self.joint}.{self.small.of}; {block[2:-2]} }}"}
        return {"integrator": self.name}

    def put(self, folder: Path) -> Use:
        """Writes the file that a course from a file reads, beside the deck; gives itself."""
        if getattr(self.model, "from_file", False):
            unit = in_words(ASKED[self.command], WORDS[JOINTS[self.joint]])
            rows = "".join(f"{t}, {x}\n" for t, x in zip(TIMES, (0.0, 0.5, 0.2), strict=True))
            text = f"time [s], {self.joint} [{unit}]\n{rows}"
            (folder / str(self.small.values["file"])).write_text(text, encoding="utf-8")
        return self


# What units mean here, said once more than in MET itself.

WATCHED = {"q": "joint", "qd": "joint/s", "qdd": "joint/s^2", "tau": "effort"}
"""Declared units of what a metric here may watch."""

ASKED = {"rate": "joint/s", "position": "joint", "torque": "effort", "acceleration": "joint/s^2"}
"""Declared units of what commands ask."""

WORDS = {"revolute": {"joint": "rad", "effort": "N*m"}, "prismatic": {"joint": "m", "effort": "N"}}
"""What the words of declared units are on a joint."""


def in_words(unit: str, words: Mapping[str, str]) -> str:
    """A declared unit with its words replaced, as a deck can write it behind a number: `m/(N*m)`, `s^-1`."""

    def factor(found: re.Match[str]) -> str:
        text = words.get(found[0], found[0])
        alone = unit[:found.start()][-1:] != "/" and unit[found.end():][:1] != "^"
        return text if alone or text.isalpha() else f"({text})"

    text = re.sub(r"[A-Za-z]+", factor, unit)
    return text.removeprefix("1/") + "^-1" if re.fullmatch(r"1/[a-z]+", text) else text


def value_of(command: str, joint: str) -> str:
    """What a command of this kind asks of a joint, as a deck writes it."""
    return f"0.5 {in_words(ASKED[command], WORDS[JOINTS[joint]])}"


def carrier(kind: str, command: str) -> str:
    """The first servo that takes this command; for a bed or law, that has a motor besides."""
    return next(name for name, servo in models.find_own("servo").items()
                if command in servo.commands and (kind == "command" or models.has_motor(servo)))  # fmt: skip


def commands(kind: str, model: Any) -> tuple[str, ...]:
    """The kinds of command under which a model is used, the smallest deck's first; ("",) where it has none."""
    if kind == "servo":
        return model.commands or ("",)
    if kind == "command":
        return tuple(ASKED)
    return ("rate",) if kind in ("bed", "law") else ("",)


def uses(kind: models.Kind, name: str, joint: str = "hinge") -> Iterator[Use]:
    """Every way to use a model: under each kind of command, and each choice of its words. The smallest deck's first."""
    model, small = models.find(kind, name), SMALLEST[kind, name]
    kinds = sorted(commands(kind, model), key=lambda command: command != small.command)
    chosen = [
        [(parameter.name, word) for word in sorted(parameter.words, key=lambda w: w != parameter.default)]
        for parameter in models.written(model) if parameter.words
    ]  # fmt: skip
    for command in kinds:
        for n, words in enumerate(itertools.product(*chosen)):
            # the defaults are left unwritten, but in a way of their own where they are written too
            yield Use(kind, name, joint, command, words={} if n == 0 else dict(words))


def smallest(kind: models.Kind, name: str, joint: str = "hinge") -> Use:
    """The model as the smallest deck uses it."""
    return next(uses(kind, name, joint))


def finite(value: Any) -> bool:
    """Whether a deck can write a default."""
    return isinstance(value, str) or all(map(math.isfinite, value if isinstance(value, tuple) else (value,)))
