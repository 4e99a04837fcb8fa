"""The files that `met new` writes: their names, their texts, and checks before writing."""

from __future__ import annotations

import dataclasses
import os
import re
from collections.abc import Mapping, Sequence
from string import Template
from typing import get_args

from ic.beginnings.deck import DECK
from ic.beginnings.models import MODELS, PROJECT, TRIAL, Beginning
from ic.language import HEADS
from met import models, units
from met.diagnostic import Problem, error
from met.host.files import new_file
from met.outputs import path_of, quoted, refusal_text

PARTS = [field.name for field in dataclasses.fields(Beginning)]


def deck(name: str, path: str | None) -> dict[str, str]:
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
        raise Problem(
            error("E344", _already_there(existing), help="--force writes over it; -o writes to another place")
        )
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


def _already_there(paths: Sequence[str]) -> str:
    named = ", ".join(f"`{path}`" for path in paths)
    return f"{named} is there already" if len(paths) == 1 else f"{named} are there already"
