"""Declarations in a model: its parameters, its memory and states, and its signals.

Checking, `met doc`, error messages, plans and archives all read these declarations, so a number's unit, range,
meaning and source are written once, in the model's own file.

A unit is written as in a deck (`"V*s/rad"`, `"1"` for a pure number). Four names stand for units that depend on the
use: `joint` (rad, or m on a prismatic joint), `effort` (N*m, or N), `command` (the unit of what is commanded) and `of`
(the unit of the channel that a metric watches, of what a sensor is of).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal

from met.frozen import frozen
from met.messages.renamed import old_fields

BASE = "base"
"""The link that the arm stands on. It has no joint, and mass only where a deck gives it some."""

WORLD = "world"
"""A word that may stand for a link: the ground, whose frame is the world's."""

ZEROS = (0.0, 0.0, 0.0)
"""Default of three numbers that need not be written."""

Shape = Literal["number", "vector", "list", "word", "text"]

Only = tuple[str, tuple[str, ...]]
"""Condition under which a part of a servo is present: the name of a word parameter, and the words that admit it."""


@frozen(kw_only=True)
class Parameter:
    """One number (or vector of three, list, word or text) that a deck may set on a model.

    `default` None means that the deck must write it. The bounds are in SI: `above` and `below` exclude their
    value, `at_least` and `at_most` include it; `whole` takes whole numbers alone. `words` lists what a word may be.
    A list, a word or a text (in quotes; for the compiler alone, no plan holds one) cannot vary in a sweep.
    `needed_for` names the kinds of command of a servo under which it must be written, default or not, and lie above
    `above_where_needed` where that is given. `of_servo` names
    the parameter of the joint's servo that a bed's parameter is where a deck does not write it. `only` is for servos'.

    names        of an environment's word: it names one of the arm's links or moving joints, or is one of `words`. Where
                 it is a joint, the unit words `joint` and `effort` of the model's other parameters are this joint's
    joints       of an environment's number: it is about joints of this kind alone, and an arm without is warned
    decides      of a number: it decides the program, as a word does, and is a plain float when the model is recorded
    direction    of a vector: its length does not count, so it may not be nothing
    less_than    of a number: the parameter that it is less than, in every case
    rises        of a list: its numbers rise, and there is one at least
    share        of a number: part of a whole, which is seldom above 1; a bare number above that is warned of
    ticks        of a frequency: how often something is done, which turns no angle: 1/s is as plain there as Hz
    as_many_as   of a list: the list that it has a number for each of; it may be empty where that is its default
    if_negative  of a number above 0: what a negative one stands for, where its magnitude may be written in its place
    timing       of a number that says when an environment acts, or a metric watches: a plan holds it only where it is
                 set. Without it the model acts always and in full, as checks of steps have it
    """

    name: str
    unit: str = "1"
    doc: str
    default: float | tuple[float, ...] | str | None = None
    above: float | None = None
    at_least: float | None = None
    below: float | None = None
    at_most: float | None = None
    whole: bool = False
    shape: Shape = "number"
    words: tuple[str, ...] = ()
    needed_for: tuple[str, ...] = ()
    above_where_needed: float | None = None
    of_servo: str = ""
    source: str = ""
    names: Literal["", "link", "joint"] = ""
    joints: Literal["", "revolute", "prismatic"] = ""
    decides: bool = False
    direction: bool = False
    less_than: str = ""
    rises: bool = False
    share: bool = False
    ticks: bool = False
    as_many_as: str = ""
    if_negative: str = ""
    timing: bool = False
    only: Only | None = None


def is_present(part: Parameter | Memory | State | Signal, words: Mapping[str, str]) -> bool:
    """True where a part of a servo is present under these words, given by the names of their parameters."""
    return part.only is None or words.get(part.only[0]) in part.only[1]


def under(parameter: Parameter, command: str) -> Parameter:
    """The parameter with the bound that holds under this kind of command."""
    if command not in parameter.needed_for or parameter.above_where_needed is None:
        return parameter
    return replace(parameter, above=parameter.above_where_needed)


@frozen(kw_only=True)
class Declaration:
    """The fields that declarations of models share.

    name        by which decks ask for the model;  doc: its description, a sentence
    parameters  its numbers and words, under their names in decks
    """

    name: str
    doc: str
    parameters: tuple[Parameter, ...] = ()


@frozen(kw_only=True)
class DeclaredNumber:
    """A number that a model holds or shows, recorded under its name.

    unit  SI;  doc: its meaning in words;  only: the words of the model's parameters with which it is there; None: all
    """

    name: str
    unit: str
    doc: str
    only: Only | None = None


@frozen(kw_only=True)
class Memory(DeclaredNumber):
    """A number that a model's computer holds from one of its ticks to the next; recorded under its name.

    limit  the parameter that its size never exceeds, by name; "": none
    """

    start: float = 0.0
    limit: str = ""


@old_fields(between="in_transmission")
@frozen(kw_only=True)
class State(DeclaredNumber):
    """A number of a model that is integrated with the motion of the arm; recorded under its name.

    in_transmission  of a servo: true of a state of what joins motor and joint, such as how far a gear is wound up.
                     Where the servo has let go of the joint it goes back to `start`, by half in each step of modified
                     Euler
    """

    start: float = 0.0
    in_transmission: bool = False


@frozen(kw_only=True)
class Signal(DeclaredNumber):
    """A number that a model shows at every instant, computed from the rest; recorded under its name.

    limit  the parameter that its size never exceeds, by name; "": none
    axes   of an environment's vector of three numbers: the axes that they are along, in words; "": it is one number
    """

    limit: str = ""
    axes: str = ""


@frozen(kw_only=True)
class Limit:
    """A limit of a model that a run may reach, named by the parameter that sets it: `upper`, or `limit.x` of a vector.

    reached  of an environment (p, world) -> whether it is reached in a state; of a command profile (p, t) -> whether at
             the time t, s. A truth that may be traced
    """

    parameter: str
    reached: Callable[[Any, Any], Any]
