"""The files that `met new` writes: their names, their texts, and checks before writing."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Mapping
from string import Template
from typing import get_args

from ic.beginnings.models import MODELS, PROJECT, TRIAL, Beginning
from ic.language import HEADS
from met import models, units
from met.diagnostic import Problem, error
from met.host.files import new_file
from met.outputs import path_of, quoted, refusal_text

DECK = """\
// $name.ic: an arm of two links, to begin from
//
//   met check $name.ic             what is wrong with it, if anything is
//   met run $name.ic               the run `lift` -> $name.h5, and a picture
//   met run $name.ic gains         the sweep, one case for each pair of values
//   met explain $name.ic elbow.servo.kp      where a value comes from
//   met fmt $name.ic               lays it out anew
//   met doc                       models there are; `met doc rigid_gearbox` says what one takes

deck 2;                                         // the edition of the language that this file is written in

let reach = 0.5 m;                              // a unit follows its number; a wrong one is an error

// Links have mass and inertia, joints say what hangs on what. z is up, because gravity says so below.
arm $name {
    link upper { mass = 4 kg;  shape = rod(length = reach, along = x); }
    link lower { mass = 2 kg;  shape = rod(length = reach, along = x); }

    joint shoulder revolute { parent = base;   child = upper;  axis = -y; }                            // up is positive
    joint elbow    revolute { parent = upper;  child = lower;  axis = -y;  at = [reach, 0 m, 0 m]; }   // of upper
}

// A motor with its gearbox and its computer. The numbers are assumptions: put those of your drive here.
servo drive {
    model      = rigid_gearbox;
    ratio      = 100;
    kp         = 0.1 V*s/rad;
    ki         = 2 V/rad;
    v_max      = 48 V;
    resistance = 0.5 ohm;
    kt         = 0.1 N*m/A;
    tau_max    = 1.2 N*m;
    j_m        = 6e-5 kg*m^2;
    f_c        = 0.01 N*m;                      // dry friction: the joint sticks
    k_position = 10 1/s;                        // a position command needs it
    command    = position(trapezoid(to = 30 deg, max_rate = 60 deg/s, max_acceleration = 90 deg/s^2));
}

// Everything that one simulation needs.
default run lift {
    arm    = $name;
    servos {
        shoulder = drive;
        elbow    = drive {
            command = position(trapezoid(to = 45 deg, max_rate = 60 deg/s, max_acceleration = 90 deg/s^2));
        }
    }
    initial     { q = 0 rad; }                  // straight out
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates       { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration    = 3 s;
    record      = [q, qd, tau, servo.voltage];  // `met doc channels` says what there is

    metric settle = settling_time { of = elbow.q;  target = 45 deg;  band = 0 %;  within = 1 deg; }
    metric effort = max           { of = shoulder.tau; }
    require settle < 2.5 s;                     // where a case misses it, `met run` exits with 1
}

sweep gains of lift {
    vary drive.kp         = [0.05, 0.1, 0.2] V*s/rad;           // of both servos
    vary links.lower.mass = [2, 3] kg;
}
"""


PARTS = [field.name for field in dataclasses.fields(Beginning)]


def new_deck(name: str, path: str | None) -> dict[str, str]:
    """A deck, by its path. Raises Problem E343 where the name is not possible for a deck."""
    check_name("an arm", name)
    return {path or f"{name}.ic": Template(DECK).substitute(name=name)}


def model(kind: str, name: str, folder: str | None) -> dict[str, str]:
    """A package of one model with a deck to try it in, by their paths.

    Raises Problem E343 where no model may be called so, or one is.
    """
    check_name("a model", name)
    of_models = next(known_kind for known_kind in get_args(models.Kind) if known_kind == kind)
    if name in models.available(of_models):
        help = f"choose another name; `met doc {kind} {name}` says what that one is"
        raise Problem(error("E343", f"there is a {kind} model `{name}` already", help=help))
    begun = MODELS[kind]
    module = f"{name}_for_met"
    parts = {field: Template(getattr(begun, field)).substitute(name=name) for field in PARTS}
    fields = {**parts, "name": name, "kind": kind, "distribution": module.replace("_", "-")}
    folder = folder or name
    return {
        os.path.join(folder, f"{module}.py"): parts["module"],
        os.path.join(folder, f"{name}.ic"): Template(TRIAL).substitute(fields),
        os.path.join(folder, "pyproject.toml"): Template(PROJECT).substitute({**fields, "module": module}),
    }


def check_name(what: str, name: str) -> None:
    """Raise Problem E343 where no arm, or no model, may have this name."""
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
        near = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_").lstrip("0123456789_")
        helps = [f"`{near}` would do"] if near and not _meaning(what, near) else []
        helps.append("a name is letters, digits and `_`, and begins with a letter")
        raise Problem(error("E343", f"{what} cannot be called `{name}`", help=helps))
    if meaning := _meaning(what, name):
        raise Problem(error("E343", f"{what} cannot be called `{name}`: {meaning}", help="choose another name"))


def _meaning(what: str, name: str) -> str:
    """The meaning, in words, of a name that is already taken; "" where the name is free."""
    if units.is_unit(name):
        return f"that is the unit {units.UNITS[name].word}"
    return "with that word paths of a run begin" if what == "an arm" and name in HEADS else ""


def write(texts: Mapping[str, str], *, force: bool) -> None:
    """Write the files, by path. Raises Problem E344, and writes none, where one exists and `force` is not given."""
    for path in texts:
        _check_place(path)
    existing = [path for path in texts if os.path.lexists(path)]
    if existing and not force:
        named = ", ".join(f"`{path}`" for path in existing)
        message = f"{named} {'is' if len(existing) == 1 else 'are'} there already"
        raise Problem(error("E344", message, help="--force writes over it; -o writes to another place"))
    for path, text in texts.items():
        if folder := os.path.dirname(path):
            os.makedirs(folder, exist_ok=True)
        put(path, text)


def put(path: str, text: str) -> None:
    """Write a new file in place of one of the same name; a link there is not followed. Raises Problem E338 where the
    system refuses; then no new file is left."""
    existed = os.path.lexists(path)
    _check_place(path)
    try:
        with new_file(path) as stream:
            stream.write(text.encode())
    except OSError as reason:
        if not existed and os.path.lexists(path):
            os.unlink(path)
        helps = "nothing was kept; -o names another place"
        raise Problem(error("E338", f"cannot write `{path}`: {refusal_text(reason)}", help=helps)) from None


def _check_place(path: str) -> None:
    """Raise Problem where no file can be written in any case: E305, or E338 in place of a folder or a pipe, or in a
    file."""
    target, folder = path_of(path), os.path.dirname(path)
    helps = "-o names another place"
    if target.is_dir():
        inside = quoted(os.path.join(path, "arm.ic"))
        raise Problem(error("E338", f"cannot write `{path}`: it is a folder", help=f"name a file in it: `-o {inside}`"))
    if os.path.exists(path) and not os.path.isfile(path):
        raise Problem(error("E338", f"cannot write `{path}`: it is not a regular file", help=helps))
    if os.path.exists(folder) and not os.path.isdir(folder):
        raise Problem(error("E338", f"cannot write `{path}`: `{folder}` is a file, not a folder", help=helps))
