"""Differences in the provenance of two archives: decks, names, parameters, models and versions, causes before
effects."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from batch.archive.read import ArchiveFile, ArchiveGroup
from batch.campaigns.changes import Change, between
from batch.differences.decks import DeckFileChange, Decks, decks
from met.frozen import frozen
from met.plan import Experiment, Plan
from met.run import comparable


@frozen
class ProvenanceChanges:
    """Differences in the provenance of two archives, in words.

    versions   of MET, its libraries and its commit
    decks      files of the decks that differ, and how
    meaning    what was written otherwise: names that stand for values, parameters, models, rates, cases
    follows    what differs because of that: parameters that are computed, those of what is new or gone
    defaults   parameters that a model has got since, and their defaults
    structure  experiments whose structures differ (models, rates, what is varied)
    code       experiments whose programs differ: where none does, equal inputs give equal bits
    results    metrics and signals of the others that are computed otherwise, by experiment and name
    kept       how histories are kept: of experiments of which one archive has them in single precision
    """

    versions: tuple[str, ...] = ()
    decks: tuple[DeckFileChange, ...] = ()
    meaning: tuple[str, ...] = ()
    follows: tuple[str, ...] = ()
    defaults: tuple[str, ...] = ()
    structure: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    results: tuple[tuple[str, str], ...] = ()
    kept: tuple[str, ...] = ()


def provenance_changes(
    a: ArchiveFile, b: ArchiveFile, pairs: Sequence[tuple[ArchiveGroup, ArchiveGroup]], plans: Sequence[Plan | str]
) -> ProvenanceChanges:
    """Compare the provenance of two archives. plans: of each, or the reason why it cannot be read here"""
    texts = decks(a.sources(), b.sources())
    meaning, follows, defaults = _meaning(plans, pairs, texts)
    causes = [*_defines(a, b), *(texts.names if meaning or follows else ())]
    return ProvenanceChanges(
        versions=tuple(_versions(a, b)),
        decks=texts.files,
        meaning=(*causes, *(meaning or (() if causes else follows))),
        follows=tuple(follows) if meaning or causes else (),
        defaults=tuple(defaults),
        structure=tuple(group.name for group, two in pairs if _other_structure(group, two)),
        code=tuple(group.name for group, two in pairs if _other_code(group.attributes, two.attributes)),
        results=tuple((group.name, name) for group, two in pairs for name in _other_results(group, two)),
        kept=tuple(
            f"histories of `{two.name}`: {_precision(group)}, now {_precision(two)}"
            for group, two in pairs
            if group.single != two.single
        ),
    )


def _precision(group: ArchiveGroup) -> str:
    return "single precision (`--float32`)" if group.single else "double precision"


def _other_code(a: Mapping[str, Any], b: Mapping[str, Any]) -> bool:
    """True if two code keys differ; False where one archive has none, or one of another kind."""
    code_a, two = a.get("code_key"), b.get("code_key")
    return comparable(code_a, two) and code_a != two


def _other_results(a: ArchiveGroup, b: ArchiveGroup) -> Iterator[str]:
    """The metrics and signals that two groups of one program compute differently."""
    if not _other_code(a.attributes, b.attributes):
        for name, variable in a.variables.items():
            other = b.variables.get(name)
            if other is not None and _other_code(variable.attributes, other.attributes):
                yield name


def _other_structure(a: ArchiveGroup, b: ArchiveGroup) -> bool:
    """True if the structures of two groups have different keys; False where one has none."""
    key_a, two = a.attributes.get("structure_key"), b.attributes.get("structure_key")
    return key_a is not None and two is not None and key_a != two


def _versions(a: ArchiveFile, b: ArchiveFile) -> Iterator[str]:
    """Lines about packages and commits of MET that differ between the two archives."""
    facts_a, facts_b = a.provenance, b.provenance
    for name in sorted({*facts_a, *facts_b}):
        if name.startswith("version_") and facts_a.get(name) != facts_b.get(name):
            yield f"{name.removeprefix('version_')} {facts_a.get(name, 'unknown')}, now {facts_b.get(name, 'unknown')}"
    commits = [
        (str(versions.get("git_commit", "unknown")), str(versions.get("git_dirty", "unknown")))
        for versions in (facts_a, facts_b)
    ]
    if commits[0] != commits[1]:
        yield "MET's commit " + ", now ".join(f"{commit[:10]}{_dirty(dirty)}" for commit, dirty in commits)
    elif commits[0][1] == "yes":
        yield f"MET's commit {commits[0][0][:10]} in both,{_dirty('yes')}, which may be others"


def _defines(a: ArchiveFile, b: ArchiveFile) -> Iterator[str]:
    """Differences of the `-D` options."""
    defines_a, two = (str(archive.provenance.get("defines") or "nothing") for archive in (a, b))
    if defines_a != two:
        yield f"-D {defines_a} -> {two}"


def _dirty(dirty: str) -> str:
    return " with changes that were not committed" if dirty == "yes" else ""


def _meaning(
    plans: Sequence[Plan | str], pairs: Sequence[tuple[ArchiveGroup, ArchiveGroup]], texts: Decks
) -> tuple[list[str], list[str], list[str]]:
    """Changes of matched experiments: written ones, and those that follow; new parameters with their defaults apart. A
    change in all of several experiments is reported once."""
    before, now = plans
    if isinstance(before, str) or isinstance(now, str):
        return [f"the plan cannot be read here: {why}" for why in plans if isinstance(why, str)], [], []
    planned_a, planned_b = ({experiment.name: experiment for experiment in plan.experiments} for plan in (before, now))
    several = [(group.name, two.name) for group, two in pairs if group.name in planned_a and two.name in planned_b]
    names_of: dict[tuple[int, str], list[str]] = {}
    for name_a, two in several:
        old, new = planned_a[name_a], planned_b[two]
        fresh = {
            path: quantity
            for path, quantity in new.parameters.items()
            if path not in old.parameters and quantity.origin.kind == "default"
        }
        for change in between(old, new, ordered=False):
            path = change.text.partition(" is new")[0]
            kind = 2 if path in fresh and not change.follows else int(_follows(change, texts))
            text = f"{path} is new, at its default{change.text.partition(' is new')[2].replace(':', ',', 1)}"
            names_of.setdefault((kind, text if kind == 2 else change.text), []).append(two)
        for line in _tolerances(old, new):
            names_of.setdefault((0, line), []).append(two)
    out: tuple[list[str], list[str], list[str]] = ([], [], [])
    for (kind, line), names in names_of.items():
        whole = len(names) == len(several)
        out[kind].extend([line] if whole else [f"{name}: {line}" for name in names])
    return out


def _follows(change: Change, texts: Decks) -> bool:
    """True if a parameter has another value although no line that writes it differs."""
    if not texts.files or (change.before is None and change.now is None):
        return change.follows
    written = [(change.before, texts.stale), (change.now, texts.fresh)]
    return change.follows or not any(
        place is not None and ((place.file, place.line) in lines or place.file not in texts.known)
        for place, lines in written
    )  # values without a file were written on a command line


def _tolerances(before: Experiment, now: Experiment) -> Iterator[str]:
    """Changes of tolerances, which change no number but its verdict."""
    old, new = ({tolerance.of: tolerance for tolerance in experiment.tolerances} for experiment in (before, now))
    for name in dict.fromkeys([*old, *new]):
        texts = [side[name].text if name in side else "none" for side in (old, new)]
        if name not in old or name not in new or old[name].value != new[name].value:
            yield f"tolerances.{name}: {texts[0]} -> {texts[1]}"
