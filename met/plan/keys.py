"""Keys of structures and cases: they identify programs and cases, and say which results are comparable.

    structure_key   the program: topology, models, schedule, and which parameters are inputs. Bits are comparable
                    only between runs whose structure keys are equal
    case_key        the coordinates of a case: path, SI value, repeat. Matches cases between archives; orders nothing
    case_id         all resolved parameters of a case, and its case_key. Names a case; replay checks it

All are hexadecimal digests of 16 characters (64 bits: among a million cases two share a name with odds of 3e-8, among a
hundred million of 3e-4), made from the shortest exact spelling of every number, so they are the same in every process
and on every platform. A deck's place, its names of definitions and the looks of links change no key.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import marshal
from collections.abc import Iterable, Sequence
from functools import lru_cache
from operator import itemgetter
from typing import Any

import numpy as np

from met.frozen import IN_KEY
from met.plan import Experiment, Formula, Structure
from met.plan.columns import blocks

DIGEST_BYTES = 8

MARSHAL = 2
"""Version of Python's marshal that writes equal values alike: later ones depend on the identity of objects."""


def in_key(field: dataclasses.Field[Any]) -> str:
    """The part of a structure's field in its key: "always", "where set" or "never" (`met.frozen.keyed`)."""
    return str(field.metadata.get(IN_KEY, "always"))


def structure_key(structure: Structure, inputs: Iterable[str] = ()) -> str:
    """The key of the program that a structure makes. inputs: the numbers that each case provides instead of being
    folded in."""
    return _digest(["structure", _described(structure), list(inputs)])


def inputs(experiment: Experiment) -> tuple[str, ...]:
    """Numbers that each case provides: coordinates, and the parameters that follow from them by formulas."""
    coordinates = [coordinate.path for coordinate in experiment.cases.coordinates]
    followers = sorted(path for path, q in experiment.parameters.items() if isinstance(q.value, Formula))
    return (*coordinates, *followers, *experiment.cases.noise)


def case_keys(experiment: Experiment, rows: Sequence[int] | np.ndarray | None = None) -> list[str]:
    """case_key of every case, or of some rows of the case table, in their order."""
    if rows is None:
        return [key for piece in blocks(experiment.cases.count) for key in case_keys(experiment, _rows(piece))]
    return _words(_case_key_digests(experiment, np.asarray(rows, np.int64)))


def case_names(experiment: Experiment, rows: np.ndarray, head: bytes | None = None) -> tuple[np.ndarray, np.ndarray]:
    """case_key and case_id of some rows of the case table, as arrays of bytes, `|S16`. head: `id_head` of the
    experiment, if known."""
    own = _case_key_digests(experiment, rows)
    return own, _case_id_digests(experiment, own, head)


def _words(digests: np.ndarray) -> list[str]:
    return [digest.decode("ascii") for digest in digests.tolist()]


def _case_key_digests(experiment: Experiment, rows: np.ndarray) -> np.ndarray:
    head, table = _row_table(experiment, rows)
    return _row_digests(head, table.view(np.uint8).reshape(len(rows), 8 * table.shape[1]))


def _row_table(experiment: Experiment, rows: np.ndarray) -> tuple[bytes, np.ndarray]:
    """The part that all rows of the case table share, and these rows: values of coordinates by path, and the repeat."""
    coordinates = sorted(experiment.cases.coordinates, key=lambda coordinate: coordinate.path)
    cases, count = experiment.cases, len(rows)
    table = np.zeros((count, len(coordinates) + 1), dtype="<f8")  # the last column is the repeat
    for column, coordinate in enumerate(coordinates):
        table[:, column] = coordinate.values[rows]
    if cases.repeats is not None:
        table[:, -1] = cases.repeats[rows]
    table += 0.0  # -0 and 0 are one value
    table[np.isnan(table)] = np.nan  # and so are all NaNs
    chosen = [[[choice.path, choice.value] for choice in sorted(cases.choices, key=lambda choice: choice.path)]]
    head = _bytes(["case_key", [coordinate.path for coordinate in coordinates], *(chosen if chosen[0] else [])])
    return head, table


def case_ids(experiment: Experiment, rows: Sequence[int] | np.ndarray | None = None) -> list[str]:
    """case_id of every case, or of some rows of the case table, in their order."""
    if rows is None:
        return [name for piece in blocks(experiment.cases.count) for name in case_ids(experiment, _rows(piece))]
    return _words(_case_id_digests(experiment, _case_key_digests(experiment, np.asarray(rows, np.int64))))


def _case_id_digests(experiment: Experiment, names: np.ndarray, head: bytes | None = None) -> np.ndarray:
    """case_id of the cases with these case_keys. head: `id_head` of the experiment, if known."""
    head = id_head(experiment) if head is None else head
    return _row_digests(head, names.view(np.uint8).reshape(len(names), 2 * DIGEST_BYTES))


def id_head(experiment: Experiment) -> bytes:
    """The part of case_ids that all cases share: parameters, formulas and seed, without the cases' values."""
    parameters = {path: _value(quantity.value) for path, quantity in experiment.parameters.items()}
    formulas = experiment.formulas
    own = [experiment.cases.seeds] if experiment.cases.seeds != "common" else []
    return _bytes(
        ["case_id", parameters, experiment.cases.seed, formulas.inputs, formulas.nodes, formulas.outputs, *own]
    )


def content_digest(question: str, experiment: Experiment, rows: Sequence[int] = ()) -> bytes:
    """Digest of a question about an experiment, with all that decides its numbers: structure, inputs, parameters, and
    the coordinates of some rows of the case table. It has 32 bytes, so that collisions can be neglected.

    It is the same in every process of one version of Python, and never written down: numbers go in as they are.
    """
    cases, formulas = experiment.cases, experiment.formulas
    parameters = [(path, _value(quantity.value)) for path, quantity in experiment.parameters.items()]
    head, table = _row_table(experiment, np.asarray(rows, np.int64))
    parts = [
        question, _described(experiment.structure), list(inputs(experiment)), [int(row) for row in rows],
        sorted(parameters, key=itemgetter(0)), cases.seed, cases.seeds, formulas.inputs, formulas.nodes,
        formulas.outputs, head, table.tobytes(),
    ]  # fmt: skip
    try:
        packed = marshal.dumps(parts, MARSHAL)
    except ValueError:  # numbers of numpy
        packed = marshal.dumps([_bytes(parts[:-2]), *parts[-2:]], MARSHAL)
    return hashlib.sha256(packed).digest()


def id_numbers(experiment: Experiment) -> np.ndarray:
    """case_id of every case as a whole number, in the order of the table: the same bits in a tenth of the memory."""
    numbers = np.empty(experiment.cases.count, ">u8")
    for piece in blocks(experiment.cases.count):
        ids = _case_id_digests(experiment, _case_key_digests(experiment, _rows(piece)))
        numbers[piece] = np.frombuffer(bytes.fromhex(ids.tobytes().decode("ascii")), ">u8")
    return numbers


def case_seeds(experiment: Experiment, rows: Sequence[int] | np.ndarray | None = None) -> np.ndarray:
    """Seed of the noise of every case, or of some rows of the case table: whole numbers below 2^53."""
    count = experiment.cases.count if rows is None else len(rows)
    seed = experiment.cases.seed
    if experiment.cases.seeds == "common":
        return np.full(count, seed, dtype=np.int64)
    mixed = (_digest(["seed", seed, case_key]) for case_key in case_keys(experiment, rows))
    return np.array([int(digest, 16) % 2**53 for digest in mixed], dtype=np.int64)


def _rows(piece: slice) -> np.ndarray:
    return np.arange(piece.start, piece.stop)


def _row_digests(head: bytes, rows: np.ndarray) -> np.ndarray:
    """One digest for each row of bytes, each begun with the same head, as bytes of text; half a microsecond a row."""
    if not len(rows):
        return np.zeros(0, f"S{2 * DIGEST_BYTES}")
    begun = hashlib.blake2b(hashlib.sha256(head).digest(), digest_size=DIGEST_BYTES).copy
    digests = []
    for row in np.ascontiguousarray(rows).view(f"V{rows.shape[1]}").ravel().tolist():
        hasher = begun()
        hasher.update(row)
        digests.append(hasher.digest())
    return np.frombuffer(b"".join(digests).hex().encode("ascii"), f"S{2 * DIGEST_BYTES}")


def _value(value: Any) -> Any:
    return {"formula": value.output} if isinstance(value, Formula) else value


def _described(value: Any) -> Any:
    """Plain data of a structure, without fields that change no number."""
    kind: Any = type(value)
    if kind is str or kind is int:
        return value
    if isinstance(value, tuple):
        return [_described(part) for part in value]
    described = {}
    for name, always, default in _fields_in_key(kind) or ():
        part = getattr(value, name)
        if always or part != default:
            described[name] = _described(part)
    return described if _fields_in_key(kind) is not None else value


@lru_cache(maxsize=256)
def _fields_in_key(kind: type) -> tuple[tuple[str, bool, Any], ...] | None:
    """The fields of a dataclass that may be in a key: name, whether always, and the default with which it is left out;
    None for other types."""
    if not dataclasses.is_dataclass(kind):
        return None
    fields = ((field, in_key(field)) for field in dataclasses.fields(kind))
    return tuple((field.name, when == "always", field.default) for field, when in fields if when != "never")


def _plain(value: Any) -> Any:
    """Every number as the shortest exact text of a float, so that 1 and 1.0, 0 and -0 are one value."""
    if isinstance(value, dict):
        return {key: _plain(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(part) for part in value]
    if isinstance(value, int | float | np.number) and not isinstance(value, bool):
        return {"number": repr(float(value) + 0.0)}
    return value


def _bytes(value: Any) -> bytes:
    return json.dumps(_plain(value), sort_keys=True, separators=(",", ":"), ensure_ascii=True).encode("ascii")


def _digest(value: Any) -> str:
    return hashlib.blake2b(_bytes(value), digest_size=DIGEST_BYTES).hexdigest()
