"""What made two archives: which parameters, models, decks and versions differ."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from batch.archive.read import ArchiveFile, Group
from batch.changes import changes
from met.frozen import frozen
from met.plan import Experiment, Plan


@frozen
class Changed:
    """What differs, in words.

    versions   of MET, its libraries and its commit
    code       experiments whose programs differ: where none does, equal inputs give equal bits
    structure  experiments whose structures differ (models, rates, what is varied)
    meaning    parameters, models, rates and cases, as the decks have them now
    defaults   parameters that a model has got since, and their defaults
    decks      files that differ, with how many lines are new and gone
    """

    versions: tuple[str, ...] = ()
    code: tuple[str, ...] = ()
    structure: tuple[str, ...] = ()
    meaning: tuple[str, ...] = ()
    defaults: tuple[str, ...] = ()
    decks: tuple[str, ...] = ()

    @property
    def anything(self) -> bool:
        return any((self.versions, self.code, self.structure, self.meaning, self.defaults, self.decks))


def changed(
    a: ArchiveFile, b: ArchiveFile, pairs: Sequence[tuple[Group, Group]], plans: Sequence[Plan | str]
) -> Changed:
    """What differs between what two archives were made from. plans: of each, or why it cannot be read here."""
    meaning, defaults = _meaning(plans, pairs)
    return Changed(
        tuple(_versions(a, b)),
        tuple(one.name for one, two in pairs if _unlike(one, two, "code_key")),
        tuple(one.name for one, two in pairs if _unlike(one, two, "structure_key")),
        tuple(meaning), tuple(defaults), tuple(_decks(a.sources(), b.sources())),
    )  # fmt: skip


def _unlike(a: Group, b: Group, name: str) -> bool:
    """Whether both say it, and say otherwise."""
    one, two = a.attributes.get(name), b.attributes.get(name)
    return one is not None and two is not None and one != two


def _versions(a: ArchiveFile, b: ArchiveFile) -> list[str]:
    one, two = a.provenance, b.provenance
    out = []
    for name in sorted({*one, *two}):
        if name.startswith("version_") and one.get(name) != two.get(name):
            out.append(f"{name.removeprefix('version_')} {one.get(name, 'unknown')}, now {two.get(name, 'unknown')}")
    commits = [(str(each.get("git_commit", "unknown")), str(each.get("git_dirty", "unknown"))) for each in (one, two)]
    if commits[0] != commits[1]:
        out.append("MET's commit " + ", now ".join(f"{commit[:10]}{_dirty(dirty)}" for commit, dirty in commits))
    elif commits[0][1] == "yes":
        out.append(f"MET's commit {commits[0][0][:10]} in both,{_dirty('yes')}, which may be others")
    if one.get("defines") != two.get("defines"):
        out.append(f"-D {one.get('defines') or 'nothing'}, now {two.get('defines') or 'nothing'}")
    return out


def _dirty(dirty: str) -> str:
    return " with changes that were not committed" if dirty == "yes" else ""


def _meaning(
    plans: Sequence[Plan | str], pairs: Sequence[tuple[Group, Group]]
) -> tuple[list[str], list[str]]:
    """Changes of matched experiments; parameters that are new, and have their defaults, apart."""
    before, now = plans
    if isinstance(before, str) or isinstance(now, str):
        return [f"the plan cannot be read here: {why}" for why in plans if isinstance(why, str)], []
    defaults: list[str] = []
    out: list[str] = []
    for one, two in pairs:
        old, new = _experiment(before, one.name), _experiment(now, two.name)
        if old is None or new is None:
            continue
        fresh = [path for path, quantity in new.parameters.items()
                 if path not in old.parameters and quantity.origin.kind == "default"]  # fmt: skip
        for path in fresh:
            quantity = new.parameters[path]
            unit = f" {quantity.unit}" if quantity.unit not in ("", "1") else ""
            defaults.append(f"{path} is new, at its default, {quantity.value}{unit}")
        told = [*changes(_alone(before, old), _alone(now, new), ordered=False), *_tolerances(old, new)]
        known = {f"{path} is new" for path in fresh}
        head = f"{two.name}: " if len(pairs) > 1 else ""
        out += [head + line for line in told if line not in known]
    return out, list(dict.fromkeys(defaults))


def _tolerances(before: Experiment, now: Experiment) -> Iterator[str]:
    """Another tolerance changes no number, but what is said of them."""
    old, new = ({each.of: each for each in one.tolerances} for one in (before, now))
    for name in dict.fromkeys([*old, *new]):
        texts = [one[name].text if name in one else "none" for one in (old, new)]
        if name not in old or name not in new or old[name].value != new[name].value:
            yield f"tolerances.{name}: {texts[0]}, now {texts[1]}"


def _experiment(plan: Plan, name: str) -> Experiment | None:
    return next((experiment for experiment in plan.experiments if experiment.name == name), None)


def _alone(plan: Plan, experiment: Experiment) -> Plan:
    """A plan of one experiment, under a name that both sides share."""
    from dataclasses import replace

    return replace(plan, experiments=(replace(experiment, name="it"),))


def _decks(a: dict[str, str], b: dict[str, str]) -> list[str]:
    """a, b: texts of the files by name, the deck itself first."""
    out = []
    heads = next(iter(a), ""), next(iter(b), "")
    if heads[0] != heads[1] and heads[0] not in b and heads[1] not in a:  # the deck has another name
        out.append(_lines(f"{heads[0]}, now {heads[1]}", a[heads[0]], b[heads[1]]))
        a, b = ({name: text for name, text in one.items() if name not in heads} for one in (a, b))
    for name in dict.fromkeys([*a, *b]):
        if name not in a or name not in b:
            out.append(f"{name} is {'new' if name in b else 'gone'}")
        elif a[name] != b[name]:
            out.append(_lines(name, a[name], b[name]))
    return out


def _lines(name: str, before: str, after: str) -> str:
    """How many lines are others."""
    old, now = (Counter(text.splitlines(keepends=True)) for text in (before, after))
    new, gone = (now - old).total(), (old - now).total()
    said = f"{new} line{'s' if new != 1 else ''} new, {gone} gone" if new or gone else "its lines are in another order"
    return f"{name}: {said if before != after else 'the same lines'}"
