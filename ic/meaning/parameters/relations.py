"""Checks of parameters together, as declared: names of the arm, directions, order, lists of one length."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any

import numpy as np

from ic.grammar.syntax import Name
from ic.language.unit_words import after_number
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.owner import XYZ, Owner
from ic.meaning.parameters.scope import Scope
from ic.text.complaints import counted, known_words
from met.diagnostic import Label, Place, did_you_mean
from met.parameter import WORLD, Parameter
from met.plan import BASE


def check_relations(
    scope: Scope,
    owner: Owner,
    parameters: Iterable[Parameter],
    body: MergedBlock,
    values: Mapping[str, Any],
    disorder: tuple[str, ...] = (),
) -> None:
    """Report parameters that contradict each other, except names of the arm, which `check_names` checks.

    disorder  the remedies for one that is not less than another, in place of leaving one of them out
    """
    for wanted in parameters:
        value, place, path = values[wanted.name], _place(owner, body, wanted.name), owner.join(wanted.name)
        if wanted.direction:
            scope.checks.require(
                value,
                no_direction,
                code="D240",
                message=f"{owner.what(wanted)} has no direction",
                place=place,
                path=path,
                needs=tuple(f"{path}.{axis}" for axis in XYZ),
                help="write numbers of ordinary size, not all of them zero",
            )
        if wanted.less_than:
            other = wanted.less_than
            scope.checks.require(
                (value, values[other]),
                partial(_not_less, owner.unit(wanted)[0]),
                code="D241",
                message=f"{owner.what(wanted)} must be less than `{other}`",
                place=place if body.get(wanted.name) is not None else _place(owner, body, other),
                path=path,
                needs=(path, owner.join(other)),
                help=disorder or f"swap them, or leave one out ({wanted.doc})",
            )
        if wanted.shape == "list":
            _check_list(scope, owner, wanted, body, values, place)


def check_names(
    scope: Scope,
    owner: Owner,
    parameters: Iterable[Parameter],
    body: MergedBlock,
    *,
    arm: str,
    known: Mapping[str, list[str]],
    failed: Iterable[str],
) -> dict[str, str]:
    """Report words that should name a link or joint of the arm; the words, as written or by default.

    known  what there is, by kind;  failed  names of which nothing can be said
    """
    words: dict[str, str] = {}
    for wanted in parameters:
        item = body.get(wanted.name)
        named = isinstance(item.value, Name) if item is not None else isinstance(wanted.default, str)
        if not wanted.names or not named:
            continue  # a missing word is reported where words are read
        word = item.value.text if item is not None and isinstance(item.value, Name) else str(wanted.default)
        names, place = [*known[wanted.names], *wanted.words], _place(owner, body, wanted.name)
        if word == WORLD and WORLD in known["link"] and WORLD not in words.values():
            scope.complaints.error(
                "D159",
                f"`{WORLD}` is the ground here, and a link of arm `{arm}`",
                place,
                help="give the link another name",
            )
        elif word not in (*names, *failed):
            others = [f"or {' or '.join(f'`{other_word}`' for other_word in wanted.words)}"] if wanted.words else []
            if word == BASE:
                others.append("the base is a link where it moves: `base = free;` in the run")
            scope.complaints.error(
                "D159",
                f"no {wanted.names} `{word}` in arm `{arm}`",
                place,
                help=[*did_you_mean(word, names), known_words(f"{wanted.names}s", known[wanted.names]), *others],
            )
        words[wanted.name] = word
    return words


def no_direction(parts: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """The rows [n, 3] without a direction, or with a length that no double holds, as a mask, and the reason in
    words."""
    with np.errstate(over="ignore", under="ignore"):
        length = np.sqrt((parts * parts).sum(axis=1))
    return ~((length > 0.0) & (length < np.inf)), []


def _not_less(unit: str, pairs: np.ndarray) -> tuple[np.ndarray, list[str]]:
    bad = ~(pairs[:, 0] < pairs[:, 1])
    unit = after_number(unit)
    return bad, [f"{low:g}{unit} is not less than {high:g}{unit}" for low, high in pairs[bad][:1]]


def _check_list(
    scope: Scope, owner: Owner, wanted: Parameter, body: MergedBlock, values: Mapping[str, Any], place: Place
) -> None:
    """Report a list that is not as long as its partner, is empty, or does not rise."""
    numbers = values[wanted.name]
    if wanted.as_many_as and (numbers or wanted.default is None) and len(numbers) != len(values[wanted.as_many_as]):
        count = len(values[wanted.as_many_as])
        scope.complaints.error(
            "D154",
            f"{owner.what(wanted)} has {counted(len(numbers), 'number')}, and `{wanted.as_many_as}` {count}",
            place,
            also=[Label(_place(owner, body, wanted.as_many_as), f"`{wanted.as_many_as}`")],
            help="they go together, one to one",
        )
    if wanted.rises and not numbers and wanted.default is None:
        scope.complaints.error("D155", f"{owner.what(wanted)} has no numbers", place, help="it has one at least")
    for n, (before, after) in enumerate(itertools.pairwise(numbers if wanted.rises else ())):
        if not after > before:
            unit = owner.unit(wanted)[0]
            scope.complaints.error(
                "D156",
                f"{owner.what(wanted)} must rise, and number {n + 2}, {after:g} {unit}, follows {before:g} {unit}",
                place,
                help=f"sort the points; for a jump, two {wanted.name} close together",
            )
            break


def _place(owner: Owner, body: MergedBlock, name: str) -> Place:
    """The place of a parameter's value, or of its owner where none is written."""
    item = body.get(name)
    return owner.place if item is None else item.value_place
