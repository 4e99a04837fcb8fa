"""The smallest deck that uses a model, of any kind, with any values: written from the model's declaration.

A model that is added gets a line in `SMALLEST`, which says what its declaration cannot: numbers that suit the arm of
this deck. All else (units, which joint, where in a deck the model stands) follows from the declaration, so that the
tests of tests/met/declarations exercise every parameter of every model, and tests/met/test_every_model.py runs each.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any, get_args

from met import models
from met.frozen import frozen
from met.parameter import Memory, Parameter, State, is_present, under
from met.plan import JointKind
from met.servos.servo import Parts, parts
from met.unit_parser import parse_unit
from met.units import PURE, Dimension
from tests.met import small_guides

KINDS: tuple[models.Kind, ...] = get_args(models.Kind)
EVERY = [(kind, name) for kind in KINDS for name in models.find_own(kind)]

JOINTS: dict[str, JointKind] = {"hinge": "revolute", "slide": "prismatic"}
"""The joints of the deck's arm, and their kinds."""

LINKS = ("bar", "tip")

FILES = {"command": "moves.csv", "environment": "loads.csv"}
"""The file that a model reads, by its kind."""

CASES = "vary initial.hinge.q = linspace(-1, 1, 7) rad;"
TIMES = (0.0, 0.1, 0.2)

DECK = """\
arm small {{
    link bar {{ mass = 2 kg; shape = rod(length = 1 m, along = x); }}
    link tip {{ mass = 1 kg; shape = sphere(radius = 0.1 m); com = [0.2, 0.1, 0] m; }}
    {base}
    joint hinge {hinge} {{ parent = {root}; child = bar; axis = y; }}
    joint slide {slide} {{ parent = bar; child = tip; axis = x; at = [1, 0, 0] m; }}
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
    "base": "",
    "root": "base",
    **JOINTS,
    "more": "",
    "servos": "",
    "gravity": "gravity = [0, 0, -9.81] m/s^2;",
    "environment": "",
    "integrator": "modified_euler",
    "metric": "final { of = slide.q; }",
    "run": "",
    "cases": CASES,
}
"""The parts of the deck, where no model writes them."""

WORDS_OF_DECK = ("root", *JOINTS, "integrator", "metric")
"""Parts that a model writes in the stead of what is there; to the others it adds."""

FREE = {"base": "link base { mass = 5 kg; inertia = [3, 4, 5] kg*m^2; }", "run": "base = free;"}
"""The parts of a deck whose base moves freely."""

Value = float | str | tuple[float, ...]


@frozen
class Small:
    """What the smallest deck that uses a model says of it.

    values   by parameter, in SI: what must be written, and what makes the model act. Of what is there under some words
             alone, what is written under these; which joint the model is about is not said (`Use.joint`)
    command  kind of command, of a servo or that in which the model stands; none: the servo's first, or a rate
    of       what of a joint a metric watches, or a sensor is of
    beside   further text for parts of the deck (`PLAIN`), as a model needs that acts on what another one does
    """

    values: Mapping[str, Value] = field(default_factory=dict)
    command: str = ""
    of: str = "qd"
    beside: Mapping[str, str] = field(default_factory=dict)


DRIVEN = {
    "more": "servo turner { model = rigid_gearbox; ratio = 100; kp = 0.1 V*s/rad; ki = 1 V/rad; v_max = 24 V; "
    "resistance = 1 ohm; kt = 0.05 N*m/A; tau_max = 1 N*m; j_m = 1e-4 kg*m^2; }\n"
    "servo pusher like turner { ratio = 100 rad/m; }",
    "servos": "hinge = turner { command = rate(0.5 rad/s); }; slide = pusher { command = rate(0.1 m/s); };",
}
"""Servos with a law and a motor on both joints, for models that are about these."""

SMALLEST: dict[tuple[str, str], Small] = {
    ("servo", "rigid_gearbox"): Small({
        "ratio": 100.0, "kp": 0.1, "ki": 1.0, "v_max": 24.0, "resistance": 1.0, "kt": 0.05, "tau_max": 1.0,
        "j_m": 1e-4, "f_c": 0.005, "k_position": 5.0, "f_s": 0.008, "rate_s": 2.0, "sigma_0": 0.01, "sigma_1": 1e-4,
    }),
    ("servo", "compliant_gearbox"): Small({
        "ratio": 100.0, "kp": 0.1, "ki": 1.0, "v_max": 24.0, "resistance": 1.0, "kt": 0.05, "tau_max": 1.0,
        "j_m": 1e-4, "f_c": 0.005, "k_position": 5.0, "f_s": 0.008, "rate_s": 2.0, "sigma_0": 0.01, "sigma_1": 1e-4,
        "loss": 0.05, "stiffness": 900.0, "hardening": 4e3, "backlash": 1e-3, "damping": 5.0, "f_c_joint": 0.1,
        "f_v_joint": 0.2,
    }),
    ("servo", "cascade"): Small({
        "ratio": 100.0, "k_position": 5.0, "feed_forward": 0.9, "kp": 0.1, "ki": 0.5, "i_max": 20.0, "k_current": 1.0,
        "ki_current": 20.0, "v_max": 24.0, "resistance": 1.0, "kt": 0.05, "inductance": 0.05, "j_m": 1e-4,
        "f_c": 0.005, "f_s": 0.008, "rate_s": 2.0, "sigma_0": 0.01, "sigma_1": 1e-4, "loss": 0.05,
        "stiffness": 900.0, "hardening": 4e3, "backlash": 1e-3, "damping": 5.0, "f_c_joint": 0.1, "f_v_joint": 0.2,
    }, command="rate"),
    ("servo", "ideal"): Small({"bandwidth": 30.0}),
    ("servo", "external"): Small({"rotor": 0.1}),
    ("servo", "passive"): Small({"friction": 1.0}),
    ("servo", "locked"): Small({"release": 0.1}),
    ("sensor", "tachometer"): Small({"cutoff": 15.0, "noise": 0.01, "resolution": 1e-3, "delay": 1.0}),
    ("sensor", "encoder"): Small({"step": 1e-3, "delay": 1.0}, command="position", of="q"),
    ("sensor", "low_pass"): Small({"cutoff": 15.0}),
    ("sensor", "accelerometer"): Small({
        "link": "tip", "at": (0.1, 0.2, 0.3), "along": (1.0, 2.0, -2.0), "cutoff": 15.0, "noise": 0.01,
        "resolution": 1e-3, "delay": 1.0, "scale": 1.01, "bias": 0.1,
    }),
    ("sensor", "gyroscope"): Small({
        "link": "tip", "along": (1.0, 2.0, -2.0), "cutoff": 15.0, "noise": 0.01, "resolution": 1e-3, "delay": 1.0,
        "scale": 1.01, "bias": 0.1,
    }),
    ("environment", "attitude_hold"): Small({
        "rpy": (0.1, -0.2, 0.3), "stiffness": (3.0, 4.0, 5.0), "damping": (0.1, 0.2, 0.3), "limit": (0.4, 0.5, 0.6),
    }, beside=FREE),
    ("environment", "brake"): Small({"torque": 1.0, "from": 0.1}),
    ("environment", "bushing"): Small({
        "link": "tip", "to": "bar", "to_at": (1.0, 0.0, 0.0), "stiffness": (90.0, 50.0, 10.0),
        "damping": (1.0, 2.0, 3.0), "turning": (5.0, 6.0, 7.0), "turning_damping": (0.1, 0.2, 0.3),
        "from": 0.05, "until": 0.15, "ramp": 0.05,
    }),
    ("environment", "contact"): Small({
        "link": "tip", "radius": 2.0, "normal": (0.1, -0.2, 1.0), "to_radius": 0.5, "stiffness": 50.0, "modulus": 20.0,
        "dissipation": 0.2, "friction": 0.3, "slip": 0.02,
    }),
    ("environment", "dead_sensor"): Small({"of": "qd", "from": 0.05, "until": 0.1}, beside=DRIVEN),
    ("environment", "free_swinging"): Small({"from": 0.05, "until": 0.1}, beside=DRIVEN),
    ("environment", "runaway"): Small({"level": 0.5, "from": 0.05, "until": 0.1}, beside=DRIVEN),
    ("environment", "gravity"): Small({"g": (0.0, 0.0, -9.81)}, beside={"gravity": ""}),
    ("environment", "gravity_gradient"): Small({"radius": 6.778e6, "frame": "orbital"}, beside={"gravity": ""}),
    ("environment", "joint_damping"): Small({"damping": 1.0}),
    ("environment", "joint_stop"): Small({
        "lower": -1e-3, "upper": 5e-3, "stiffness": 900.0, "dissipation": 0.5,
    }),
    ("environment", "plume"): Small({
        "link": "tip", "width": 0.2, "height": 0.1, "cells": 2.0, "nozzle": (1.0, 0.0, 2.0), "axis": (0.0, 0.0, -1.0),
        "thrust": 50.0, "exponent": 5.0, "duty": 0.5, "period": 0.03, "switches": (0.01, 0.1, 0.15),
    }),
    ("environment", "spring"): Small({"link": "tip", "stiffness": 90.0, "damping": 2.0, "length": 1.0}),
    ("environment", "wrench"): Small({"link": "tip", "force": (1.0, 2.0, 3.0), "until": 0.1}),
    ("environment", "wrench_table"): Small({
        "link": "tip", "times": (0.0, 0.1, 0.15), "force_z": (0.0, 9.0, 2.0), "moment_x": (1.0, -1.0, 0.5),
    }),
    ("guide", "resolved_rate"): Small({
        "link": "tip", "point": (0.3, 0.2, 0.1), "max_damping": 0.1, "threshold": 0.2, "gain": 2.0,
        "max_rate": 0.4,
    }),
    ("guide", "together"): Small({"to": 0.3, "max_rate": 2.0, "max_acceleration": 50.0}),
    ("command", "constant"): Small({"value": 0.5}),
    ("command", "step"): Small({"to": 0.5, "at": 0.1}),
    ("command", "pulse"): Small({"to": 0.5, "slope": 20.0, "over": 0.12}),
    ("command", "ramp"): Small({"to": 0.5, "over": 0.1}),
    ("command", "sine"): Small({"amplitude": 0.5, "frequency": 3.0}),
    ("command", "table"): Small({"times": (0.0, 0.1), "values": (0.0, 0.5)}),
    ("command", "chirp"): Small({"amplitude": 0.5, "f0": 1.0, "f1": 9.0, "over": 0.2}),
    ("command", "trapezoid"): Small({"to": 0.5, "max_rate": 9.0, "max_acceleration": 300.0}),
    ("command", "trajectory"): Small({"file": FILES["command"]}),
    ("metric", "final"): Small(of="q"),
    ("metric", "max"): Small(),
    ("metric", "min"): Small(of="qdd"),
    ("metric", "overshoot"): Small({"target": 0.1}, of="q"),
    ("metric", "peak"): Small(of="qdd"),
    ("metric", "rms"): Small(),
    ("metric", "settling_time"): Small({"target": 0.1, "within": 0.05}, of="q"),
    ("metric", "always"): Small({"after": 0.1, "within": 0.05}),
    ("metric", "eventually"): Small({"after": 0.1, "within": 0.05}),
    ("metric", "never"): Small({"after": 0.1, "within": 0.05}),
    ("metric", "holds_for"): Small({"time": 0.02, "after": 0.1, "within": 0.05}),
    ("metric", "share_of_time"): Small({"after": 0.1, "within": 0.05}),
    **{("integrator", name): Small() for name in models.find_own("integrator")},
    **{(kind, name): Small() for kind in ("bed", "law") for name in models.find_own(kind)},
}  # fmt: skip


@frozen
class Use:
    """A model in the small deck.

    joint    the joint that it is on, or whose channel a metric watches; of a guide, which moves others too, the one
             whose parameters a deck is to write
    command  kind of the joint's command, or of all joints that follow a guide; "" where the model has to do with none
    carrier  of a command, sensor, bed or law: the servo that it stands in; "" for the first that takes it
    words    words that it writes, by parameter, in the stead of the smallest deck's
    analog   whether the law of the servo is continuous, its own or that in which it stands
    file     whether the lists that a deck could write are columns of a file, in their stead
    for_all  of a guide: whether what each joint has is written once for all of them, which are then of one kind
    """

    kind: models.Kind
    name: str
    joint: str = "hinge"
    command: str = ""
    carrier: str = ""
    words: Mapping[str, str] = field(default_factory=dict)
    analog: bool = False
    file: bool = False
    for_all: bool = False

    @property
    def model(self) -> Any:
        return models.find(self.kind, self.name)

    @property
    def small(self) -> Small:
        return SMALLEST[self.kind, self.name]

    @property
    def on_link(self) -> bool:
        """Whether it is a sensor of a link, which stands in the run."""
        return self.kind == "sensor" and self.model.measures is not None

    @property
    def head(self) -> str:
        """What the paths of its parameters begin with."""
        of_joint = f"{self.joint}.servo.sensor.{self.small.of}"
        return {
            "servo": f"{self.joint}.servo",
            "sensor": "sensors.used" if self.on_link else of_joint,
            "command": f"{self.joint}.servo.command",
            "environment": "environment.used",
            "guide": "guides.used",
            "metric": "metrics.m",
            "bed": f"{self.joint}.bed",
            "law": f"{self.joint}.law",
            "integrator": "integrator",
        }[self.kind]

    @property
    def label(self) -> str:
        """What messages call it."""
        return {
            "servo": "servo `used`",
            "sensor": "sensor `used`" if self.on_link else f"sensor `{self.small.of}` of servo `used`",
            "command": f"`{self.name}`",
            "environment": "environment `used`",
            "guide": "guide `used`",
            "metric": "metric `m`",
            "bed": f"bed `{self.name}` of joint `{self.joint}`",
            "law": f"law `{self.name}` of joint `{self.joint}`",
            "integrator": "",
        }[self.kind]

    @property
    def of_joint(self) -> tuple[Parameter, ...]:
        """What each joint has of its own that follows a guide."""
        return getattr(self.model, "of_joint", ())

    def owner(self, parameter: Parameter) -> str:
        """What messages call whatever has the parameter; the first joint, where it is written for all."""
        joint = next(iter(self.kinds)) if self.for_all else self.joint
        return f"joint `{joint}` of {self.label}" if parameter in self.of_joint else self.label

    def key(self, parameter: Parameter) -> str:
        """What a deck writes it under."""
        own = parameter in self.of_joint and not self.for_all
        return f"{self.joint}.{parameter.name}" if own else parameter.name

    def path(self, parameter: Parameter) -> str:
        """What its path in a plan is, or begins with."""
        head = f"{self.head}.{self.joint}" if parameter in self.of_joint else self.head
        return f"{head}.{parameter.name}"

    @property
    def kinds(self) -> dict[str, JointKind]:
        """The joints that follow the guide, and their kinds."""
        link = str(self.values.get("link", ""))
        kinds = {**{joint: kind for joint, (kind, _) in small_guides.INBOARD.items()}, **JOINTS}
        found = small_guides.followers(self.model, self.chosen, link)
        return {joint: JOINTS[self.joint] if self.for_all else kinds[joint] for joint in found}

    @property
    def values(self) -> dict[str, Value]:
        """What the smallest deck writes, in SI, by parameter; of those that are there."""
        known = [parameter.name for parameter in self.parameters()]
        about = {parameter.name: self.joint for parameter in self.parameters() if parameter.names == "joint"}
        file = {"file": FILES[self.kind]} if self.file else {}
        said = {**self.small.values, **about, **file, **self.words}
        return {name: value for name, value in said.items() if name in known}

    @property
    def chosen(self) -> dict[str, str]:
        """Every word of the model here, written or not."""
        said = {**self.small.values, **self.words}
        return {p.name: str(said.get(p.name, p.default)) for p in models.written(self.model) if p.words}

    def parameters(self) -> tuple[Parameter, ...]:
        """The parameters that a deck may write here, with the bounds that hold here."""
        declared = {parameter.name: parameter for parameter in self.of_joint}
        written = (declared.get(parameter.name, parameter) for parameter in models.written(self.model))
        return self._here(written, lists=not self.file)

    def absent(self) -> tuple[Parameter, ...]:
        """Those that are there under other words alone."""
        written = models.written(self.model)
        here = [parameter.name for parameter in written if is_present(parameter, self.chosen)]
        return tuple(parameter for parameter in written if parameter.name not in here)

    def in_plan(self) -> tuple[Parameter, ...]:
        """The parameters that a plan holds of it, which the model's functions read."""
        declared = (*getattr(self.model, "parameters", ()), *self.of_joint)
        return self._here([parameter for parameter in declared if parameter.shape != "text"])

    def _here(self, declared: Iterable[Parameter], *, lists: bool = True) -> tuple[Parameter, ...]:
        return tuple(
            under(parameter, self.command)
            for parameter in declared
            if is_present(parameter, self.chosen) and (lists or parameter.shape != "list")
        )

    @property
    def parts(self) -> Parts:
        """What there is of the servo."""
        return parts(self.model, self.chosen, continuous=self.analog)

    def held(self, group: str) -> tuple[Memory | State, ...]:
        """What there is of a group of what the model holds: `memory`, `states`."""
        return tuple(part for part in getattr(self.model, group) if is_present(part, self.chosen))

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

    def deck(
        self,
        written: Mapping[str, str] | None = None,
        *,
        without: Collection[str] = (),
        before: str = "",
        cases: str = CASES,
    ) -> str:
        """The deck.

        written  texts of parameters, in the stead of the smallest deck's or besides
        without  parameters that are left out
        before   what stands before all else;  cases: the body of its sweep
        """
        entries = {name: self.text(self.parameter(name), value) for name, value in self.values.items()}
        entries |= written or {}
        parts = {**PLAIN, **self.small.beside, "cases": cases}
        own = self._parts({name: text for name, text in entries.items() if name not in without})
        return before + DECK.format(
            **parts | {name: text if name in WORDS_OF_DECK else f"{parts[name]} {text}" for name, text in own.items()}
        )

    def _parts(self, entries: Mapping[str, str]) -> dict[str, str]:
        """The parts of the deck in which it stands, with its entries."""
        block = f"{{ {' '.join(f'{name} = {text};' for name, text in entries.items())} }}"
        call = f"({', '.join(f'{name} = {text}' for name, text in entries.items())})" if entries else ""
        if self.kind == "servo":
            asked = f"command = {self.command}({value_of(self.command, self.joint)});" if self.command else ""
            rate = "rate = continuous;" if self.analog else ""
            definition = f"servo used {{ model = {self.name}; {block[2:-2]} {asked} {rate} }}"
            return {"more": definition, "servos": f"{self.joint} = used;"}
        if self.on_link:
            return {"run": f"sensor used = {self.name} {{ rate = 125 Hz; {block[2:]}"}
        if self.kind == "sensor":
            servo = replace(self, kind="servo", name=self.carrier or carrier(self.kind, self.command), words={})
            taken = servo._parts(
                {name: servo.text(servo.parameter(name), value) for name, value in servo.values.items()}
            )
            sensor = f"sensor {self.small.of} = {self.name} {block};"
            return {**taken, "more": f"{taken['more'].removesuffix('}')} {sensor} }}"}
        if self.kind in ("command", "bed", "law"):
            asked = f"{self.name}{call}" if self.kind == "command" else value_of(self.command, self.joint)
            servo = replace(self, kind="servo", name=self.carrier or carrier(self.kind, self.command), words={})
            taken = servo._parts(
                {name: servo.text(servo.parameter(name), value) for name, value in servo.values.items()}
            )
            taken["servos"] = f"{self.joint} = used {{ command = {self.command}({asked}); }};"
            put = f"substitute {self.joint} {{ {self.kind} = {self.name}{call}; }}"
            return taken if self.kind == "command" else {**taken, "run": put}
        if self.kind == "guide":
            return self._guide(entries)
        if self.kind == "environment":
            return {"environment": f"used = {self.name} {block};"}
        if self.kind == "metric":
            of = f"{self.joint}.{self.small.of}"
            of = f"{of} < 0.5 * {of}" if models.find("metric", self.name).condition else of
            return {"metric": f"{self.name} {{ of = {of}; {block[2:-2]} }}"}
        return {"integrator": self.name}

    def _guide(self, entries: Mapping[str, str]) -> dict[str, str]:
        """The parts of the deck with a guide, whose joints have servos of their kinds."""
        kinds, alike = self.kinds, {kind: joint for joint, kind in JOINTS.items()}
        servos = {
            kind: replace(
                self, kind="servo", name=carrier("servo", self.command), joint=alike[kind], words={}, for_all=False
            )
            for kind in kinds.values()
        }
        definitions = [
            f"servo of_{kind} {{ model = {servo.name}; "
            + " ".join(f"{name} = {servo.text(servo.parameter(name), x)};" for name, x in servo.values.items())
            + f" command = {self.command}(used); }}"
            for kind, servo in servos.items()
        ]
        written = [f"{self.key(self.parameter(name))} = {text};" for name, text in entries.items()]
        others = {} if self.for_all else {joint: kind for joint, kind in kinds.items() if joint != self.joint}
        for wanted in self.of_joint:
            written += [
                f"{joint}.{wanted.name} = {replace(self, joint=alike[kind]).text(wanted, value)};"
                for joint, kind in others.items()
                if (value := self.small.values.get(wanted.name)) is not None
            ]
        body = small_guides.body(self.model, small_guides.components(self.model, self.chosen), written)
        own = dict.fromkeys(JOINTS, JOINTS[self.joint]) if self.for_all else {}
        return {
            **small_guides.inboard(kinds),
            **own,
            "more": "\n".join(definitions),
            "servos": " ".join(f"{joint} = of_{kind};" for joint, kind in kinds.items()),
            "run": f"guide used = {self.name} {{ {body} }}",
        }

    def put(self, folder: Path) -> Use:
        """Writes the file that a course from a file reads, beside the deck; gives itself."""
        if getattr(self.model, "from_file", False):
            columns = (
                [(self.joint, in_words(ASKED[self.command], WORDS[JOINTS[self.joint]]))]
                if self.command
                else [(parameter.name, parameter.unit) for parameter in self.model.parameters if parameter.as_many_as]
            )
            heads = "".join(f", {name} [{unit}]" for name, unit in columns)
            rows = "".join(f"{t}{f', {x}' * len(columns)}\n" for t, x in zip(TIMES, (0.0, 0.5, 0.2), strict=True))
            (folder / FILES[self.kind]).write_text(f"time [s]{heads}\n{rows}", encoding="utf-8")
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
        alone = unit[: found.start()][-1:] != "/" and unit[found.end() :][:1] != "^"
        return text if alone or text.isalpha() else f"({text})"

    text = re.sub(r"[A-Za-z]+", factor, unit)
    return text.removeprefix("1/") + "^-1" if re.fullmatch(r"1/[a-z]+", text) else text


def value_of(command: str, joint: str) -> str:
    """What a command of this kind asks of a joint, as a deck writes it."""
    return f"0.5 {in_words(ASKED[command], WORDS[JOINTS[joint]])}"


def carrier(kind: str, command: str) -> str:
    """The first servo that takes this command; for a bed or law, that has a motor besides."""
    on_bed = kind in ("bed", "law")
    return next(
        name
        for name, servo in models.find_own("servo").items()
        if command in servo.commands and (models.has_motor(servo) or not on_bed)
    )


def commands(kind: str, model: Any) -> tuple[str, ...]:
    """The kinds of command under which a model is used, the smallest deck's first; ("",) where it has none."""
    if kind in ("servo", "guide"):
        return model.commands or ("",)
    if kind == "command":
        return tuple(ASKED)
    if kind == "sensor" and model.measures is None:
        return (SMALLEST[kind, model.name].command or "rate",)
    return ("rate",) if kind in ("bed", "law") else ("",)


def uses(kind: models.Kind, name: str, joint: str = "hinge") -> Iterator[Use]:
    """Every way to use a model, the smallest deck's first.

    Under each kind of command: each choice of its words; then each other link of the arm that one of them may name;
    then with its lists in a file, where it takes one for them; then with its law continuous, where it may be; then
    with what each joint has written for all.
    """
    model, small = models.find(kind, name), SMALLEST[kind, name]
    kinds = sorted(commands(kind, model), key=lambda command: command != small.command)

    def first(parameter: Parameter) -> Value | None:
        return small.values.get(parameter.name, parameter.default)  # type: ignore[return-value]

    written = models.written(model)
    chosen = [
        [(p.name, word) for word in sorted(p.words, key=lambda word, p=p: word != first(p))]
        for p in written
        if p.words and not p.names
    ]
    links = [(p.name, link) for p in written if p.names == "link" for link in (*LINKS, *p.words) if link != first(p)]
    for command in kinds:
        plain = Use(kind, name, joint, command)
        for n, words in enumerate(itertools.product(*chosen)):
            # the defaults are left unwritten, but in a way of their own where they are written too
            yield plain if n == 0 else replace(plain, words=dict(words))
        for part, link in links:
            yield replace(plain, words={part: link})
        if kind == "environment" and model.from_file:
            yield replace(plain, file=True)
        if not getattr(model, "clocked", True) and not (kind == "servo" and model.control is None):
            yield replace(plain, analog=True)
        if getattr(model, "of_joint", ()):
            yield replace(plain, for_all=True)


def first_uses(kind: models.Kind, name: str, joint: str = "hinge") -> Iterator[tuple[Use, list[Parameter]]]:
    """The uses, under each kind of command, in which parameters are written that were in none before; and these."""
    seen: set[tuple[str, str]] = set()
    for use in uses(kind, name, joint):
        new = [parameter for parameter in use.parameters() if (use.command, use.key(parameter)) not in seen]
        seen |= {(use.command, use.key(parameter)) for parameter in new}
        if new and not use.file:
            yield use, new


def smallest(kind: models.Kind, name: str, joint: str = "hinge") -> Use:
    """The model as the smallest deck uses it."""
    return next(uses(kind, name, joint))


def finite(value: Any) -> bool:
    """Whether a deck can write a default."""
    numbers = value if isinstance(value, tuple) else (value,)
    return isinstance(value, str) or (bool(numbers) and all(map(math.isfinite, numbers)))
