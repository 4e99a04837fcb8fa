"""Keys of a run that a plan keeps: one declaration is read, checked, explained, varied and kept out of older keys."""

from __future__ import annotations

import dataclasses

import ic
import ic.language
from ic.find import find
from ic.language.declaration import Entry
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters.owner import Owner
from ic.meaning.runs.base import resolve_run_keys
from met.diagnostic import Place
from met.frozen import frozen
from met.parameter import Parameter
from met.plan import Structure
from met.plan.keys import _described
from met.plan.run_keys import RunKey, run_key, run_keys

SPEED = RunKey(
    path="guard_speed", parameter=Parameter(name="guard_speed", unit="m/s", default=2.5, above=0.0, doc="a limit")
)
COUNT = RunKey(path="laps", parameter=Parameter(name="laps", default=3.0, at_least=1.0, whole=True, doc="how often"))


@frozen
class Kept:
    arm: str
    guard_speed: float = run_key(SPEED)
    laps: int = run_key(COUNT)


def test_every_key_of_a_structure_goes_to_the_deck_and_back():
    keys = dict(run_keys(Structure))
    assert {"velocity_products", "balanced"} <= set(keys)
    for key in keys.values():
        for word in key.parameter.words:
            assert key.in_deck(key.in_plan(word)) == word


def test_every_key_has_an_entry_in_the_language():
    for _, key in run_keys(Structure):
        head, _, name = key.path.rpartition(".")
        entry = ic.language.BLOCKS[head or "run"][name]
        assert entry.parameter is key.parameter and entry.path == key.path


def test_what_older_plans_lack_is_the_default_and_changes_no_key():
    assert Kept("a").guard_speed == 2.5 and Kept("a").laps == 3 and type(Kept("a").laps) is int
    assert _described(Kept("a")) == {"arm": "a"}
    assert _described(Kept("a", guard_speed=3.0)) == {"arm": "a", "guard_speed": 3.0}


def test_the_entry_takes_name_type_and_default_from_the_declaration():
    entry = Entry.of_plan(SPEED, "guard_speed = 2 m/s;")
    assert (entry.name, entry.unit, entry.default, entry.doc) == ("guard_speed", "m/s", "2.5 m/s", "a limit")


def test_a_key_that_is_left_out_is_its_default_and_can_be_explained(monkeypatch):
    scope = ic.check(find("two_link.ic")).scopes[0]
    run = ic.language.BLOCKS["run"]
    entries = (*run.entries, Entry.of_plan(SPEED, "..."), Entry.of_plan(COUNT, "...", varies="never"))
    monkeypatch.setitem(ic.language.BLOCKS, "run", dataclasses.replace(run, entries=entries))
    owner = Owner("run `r`", Place("d.ic", 1, 1, 1), "")
    assert resolve_run_keys(scope, owner, MergedBlock(), Kept) == {"guard_speed": 2.5, "laps": 3}
    assert scope.settled("guard_speed").value == 2.5
    assert not scope.not_sweepable["laps"].is_choice
