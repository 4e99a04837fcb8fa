"""Archives with something else in them than MET writes: chosen by a seed, one to three changes each.

python -m tests.batch.foreign.mutations FIRST LAST     tries these seeds, and shows what breaks
"""

from __future__ import annotations

import contextlib
import json
import random
import re
import shutil
import signal
import sys
import tempfile
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from met import cli
from tests.batch.foreign.archives import Said, made, met, readers

WORDS = (
    "", " ", "a" * 300, "\x1b[31mred\x1b[0m", "\u202ereversed", "=1+2", "a/b", "../up", "two\nlines", "<script>",
    "</script><b>", "links.leaf", "case", "rad", "1", "-", "%", "$x$", "\\n", "deg/s", "\u009b2J", "open", "#0",
    "hinge", "time", "{}", "q", "nan",
)  # fmt: skip
NUMBERS = (
    0.0, -0.0, 1.0, -1.0, 2.0, 3.0, 99.0, float("nan"), float("inf"), float("-inf"), 1.7e308, -1.7e308, 5e-324, 1e19,
    -9e18, 2.0**31, 2.0**53,
)  # fmt: skip
TYPES = ("<f8", "<f4", "<f2", ">f8", "<i8", "<i4", "i1", "u1", "<u8", ">i2", "S8", "O")
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""Nothing that is said to people has one."""

PATIENCE_SECONDS = 60

NOT_TO_BE_DONE = (TypeError, ValueError, OSError, RuntimeError, KeyError, OverflowError)
"""What h5py says of a change that cannot be made."""


def mutate(path: Path, seed: int) -> list[str]:
    """Change an archive; what was changed, in words."""
    chance = random.Random(seed)
    with h5py.File(path, "r+") as file:
        return [_change(chance, file) for _ in range(chance.choice((1, 1, 2, 3)))]


def _change(chance: random.Random, file: Any) -> str:
    names: list[str] = []
    file.visit(names.append)
    sets = [name for name in names if isinstance(file[name], h5py.Dataset)]
    groups = [name for name in names if name not in sets]
    kind = chance.choice(("value", "value", "values", "type", "shape", "gone", "moved", "copied", "scale", "attribute",
                          "attribute", "attribute", "group", "root", "plan", "plan", "plan"))  # fmt: skip
    if kind == "root" or not names:
        return f"root: {_attribute(chance, file)}"
    if kind == "group" and groups:
        return _group(chance, file, chance.choice(groups))
    if kind == "plan" and "provenance/plan" in sets:
        with contextlib.suppress(*NOT_TO_BE_DONE):  # it may be no plan any more
            return _plan(chance, file["provenance"])
    name = chance.choice(sets or names)
    with contextlib.suppress(*NOT_TO_BE_DONE):
        if kind == "attribute":
            return f"{name}: {_attribute(chance, file[name])}"
        return f"{name}: {_dataset(chance, file, name, kind)}"
    return f"{name}: {kind} could not be changed"


def _dataset(chance: random.Random, file: Any, name: str, kind: str) -> str:
    node = file[name]
    if kind == "gone":
        del file[name]
        return "gone"
    if kind in ("moved", "copied"):
        to = f"{name.rpartition('/')[0]}/{chance.choice(WORDS) or 'x'}"
        (file.move if kind == "moved" else file.copy)(name, to)
        return f"{kind} to {to!r}"
    if kind == "scale":
        what = chance.choice(("DIMENSION_LIST", "CLASS", "REFERENCE_LIST", "NAME"))
        del node.attrs[what]
        return f"without {what}"
    if kind == "value":
        where = tuple(chance.randrange(size) for size in node.shape)
        value = _value(chance, node.dtype)
        node[where] = value
        return f"{value!r} at {where}"
    values = node[...]
    if kind == "values":
        how = chance.choice(("reversed", "all alike", "shuffled"))
        if how == "all alike":
            values[...] = _value(chance, node.dtype)
        else:
            order = list(range(len(values)))
            order = order[::-1] if how == "reversed" else chance.sample(order, len(order))
            values = values[order]
        node[...] = values
        return how
    if kind == "type":
        dtype = chance.choice(TYPES)
        numbers = values if values.dtype.kind != "O" else np.arange(values.size).reshape(values.shape)
        made = numbers.astype("S").astype(object) if dtype == "O" else numbers.astype(dtype)
        _put(file, name, made, h5py.string_dtype("utf-8") if dtype == "O" else None)
        return f"of type {dtype}"
    shape = chance.choice(((), (0,), (1,), (2,), (3, 1), (1, 2, 3, 4), *[(size + by,) for size in node.shape[:1]
                                                                        for by in (-1, 1, 1000)]))  # fmt: skip
    made = np.resize(values, shape) if values.size else np.zeros(shape, values.dtype)
    _put(file, name, made, node.dtype if values.dtype.kind == "O" else None)
    return f"of shape {shape}"


def _put(file: Any, name: str, values: np.ndarray, dtype: Any) -> None:
    """Something else under a name, with its attributes and, where it fits, its dimensions."""
    before = {key: value for key, value in file[name].attrs.items()
              if key not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")}  # fmt: skip
    scale = file[name].is_scale
    dims = [axis[0].name if len(axis) else "" for axis in file[name].dims]
    del file[name]
    node = file.create_dataset(name, data=values, dtype=dtype)
    for key, value in before.items():
        node.attrs[key] = value
    with contextlib.suppress(Exception):
        if scale:
            node.make_scale(name.rpartition("/")[2])
        for axis, dim in enumerate(dims):
            if dim and dim in file:
                node.dims[axis].attach_scale(file[dim])


def _value(chance: random.Random, dtype: Any) -> Any:
    if dtype.kind in "OS":
        return chance.choice((*WORDS, b"\xff\xfe"))
    number = chance.choice(NUMBERS)
    if dtype.kind in "iu":
        about = np.iinfo(dtype)
        return int(max(about.min, min(about.max, number))) if np.isfinite(number) else about.max
    return number


def _attribute(chance: random.Random, node: Any) -> str:
    names = [name for name in node.attrs if name not in ("DIMENSION_LIST", "REFERENCE_LIST", "CLASS", "NAME")]
    name = chance.choice([*names, "deck_scale", "deck_unit", "units", "coordinates", "role"])
    if chance.random() < 0.15 and name in names:
        del node.attrs[name]
        return f"without {name}"
    value = chance.choice((
        chance.choice(WORDS), chance.choice(WORDS), chance.choice(NUMBERS), chance.choice((0, 1, -1, 2**40, -(2**60))),
        np.array([chance.choice(NUMBERS)]), ["a", "b", "c"], np.arange(3), h5py.Empty("f8"), np.True_,
        b"\xff\xfe", np.float32(1.5), np.zeros((2, 2)), np.array([], "f8"),
    ))  # fmt: skip
    node.attrs[name] = value
    return f"{name} = {value!r}"


def _group(chance: random.Random, file: Any, name: str) -> str:
    kind = chance.choice(("gone", "moved", "copied", "attribute", "emptied"))
    if kind == "attribute":
        return f"{name}: {_attribute(chance, file[name])}"
    if kind == "gone":
        del file[name]
    elif kind == "emptied":
        del file[name]
        file.create_group(name)
    else:
        to = chance.choice(WORDS).strip("/.") or "x"
        with contextlib.suppress(ValueError, OSError, RuntimeError):
            (file.move if kind == "moved" else file.copy)(name, to)
        return f"{name}: {kind} to {to!r}"
    return f"{name}: {kind}"


def _plan(chance: random.Random, provenance: Any) -> str:
    """Something else at one place of the plan's JSON."""
    document = json.loads(provenance["plan"].asstr()[()])
    path = mutate_json(chance, document)
    del provenance["plan"]
    provenance.create_dataset("plan", data=json.dumps(document), dtype=h5py.string_dtype("utf-8"))
    return f"plan{path}"


def mutate_json(chance: random.Random, document: Any) -> str:
    """Something else at one place of a document; which, in words."""
    node, path = document, ""
    while True:
        keys: list[Any] = list(node) if isinstance(node, dict) else list(range(len(node)))
        if not keys:
            break
        key = chance.choice(keys)
        path += f".{key}"
        if isinstance(node[key], dict | list) and node[key] and chance.random() < 0.85:
            node = node[key]
            continue
        if chance.random() < 0.2:
            del node[key]
            path += " gone"
        else:
            node[key] = chance.choice((None, True, 0, -1, 1, 1e308, 10**30, "", "nan", "x\x1b[31m", "../a", [], {},
                                       [[]], [1, 2, 3], {"word": "x"}, {"formula": 0}, 0.5,
                                       float("nan"), "a/b"))  # fmt: skip
            path += f" = {node[key]!r}"
        break
    return path


def wrong(said: Said, words: tuple[str, ...]) -> str:
    """What should not be about what a command said; empty where all is well."""
    if said.status not in (cli.YES, cli.NO, cli.BAD_INPUT):
        return f"exit {said.status}: {said.text[-2000:]}"
    if "Traceback" in said.text or "defect of MET" in said.text:
        return said.text[-2000:]
    found = CONTROL.search(said.text)
    return f"raw {found[0]!r} in {said.text[max(0, found.start() - 60) : found.end() + 20]!r}" if found else ""


def tried(archive: Path, folder: Path, seed: int, most: int = 3) -> list[str]:
    """Change a copy of an archive, and have some of the commands read it; what is wrong with what they say."""
    copy = folder / "given.h5"
    shutil.copy(archive, copy)
    did = mutate(copy, seed)
    commands = readers(copy, folder, archive)
    names = random.Random(f"{seed} commands").sample(sorted(commands), most)
    found = []
    for name in names:
        if why := wrong(met(*commands[name]), commands[name]):
            found.append(f"seed {seed}, {name}, after {did}: {why}")
    for path in folder.iterdir():
        if path.is_file() and path != copy:
            path.unlink()
    return found


def _too_long(*_: object) -> None:
    raise AssertionError("it takes too long")


def main(first: int, last: int, try_one: Callable[..., list[str]] = tried) -> None:
    """Try seeds; what breaks is told once for each place in the source where it does."""
    at: list[str] = []
    places: dict[str, int] = {}

    def confess(defect: Exception, *_: object, **__: object) -> None:
        frames = traceback.extract_tb(defect.__traceback__)
        own = [frame for frame in frames if "/lib/python" not in frame.filename]
        at.append(f"{type(defect).__name__}: {defect} @ " + " < ".join(
            f"{Path(frame.filename).name}:{frame.lineno}" for frame in reversed(own[-4:])))  # fmt: skip

    cli.confess = confess
    signal.signal(signal.SIGALRM, _too_long)
    warnings.simplefilter("error")
    folder = Path(tempfile.mkdtemp())
    (folder / "work").mkdir()
    archives = [made(folder, "open").rename(folder / "single.h5"), made(folder)]
    for seed in range(first, last):
        signal.alarm(PATIENCE_SECONDS)
        for why in try_one(archives[seed % 2], folder / "work", seed, int(sys.argv[3]) if len(sys.argv) > 3 else 12):
            place = at[-1].rpartition("@")[2] if at and "exit 70" in why else why.partition(": raw")[0]
            key = place if "exit 70" in why else why[:60]
            places[key] = places.get(key, 0) + 1
            if places[key] == 1:
                print(why.replace("\n", " | ")[:600], at[-1] if at and "exit 70" in why else "", flush=True)
    signal.alarm(0)
    print(f"{last - first} tried, {sum(places.values())} wrong, at {len(places)} places")
    for key, count in sorted(places.items(), key=lambda each: -each[1]):
        print(count, key[:200])


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
