"""Entries of a scope that are resolved once, and entered in the scopes of all runs that have them."""

from __future__ import annotations

from collections.abc import Mapping

from ic.meaning.expressions.names import FoundNames
from ic.meaning.parameters.owner import NotSweepable, Settled
from ic.meaning.parameters.scope import Scope
from met.frozen import frozen


@frozen
class SharedEntries:
    """The entries of a scope that holds nothing but one part of a deck.

    parameters, auxiliary, known, not_sweepable  as the scope has them
    names  what the `let`s that the part is made of are worth
    """

    parameters: Mapping[str, Settled]
    auxiliary: Mapping[str, Settled]
    known: Mapping[str, list[str]]
    not_sweepable: Mapping[str, NotSweepable]
    names: FoundNames

    @classmethod
    def of(cls, alone: Scope) -> SharedEntries | None:
        """The entries of a scope; None where it has a remark, a check or anything else that is of one run alone."""
        if alone.notes or alone.targets or alone.removed or alone.joint_kinds or not alone.checks.is_clear:
            return None
        return cls(alone.parameters, alone.auxiliary, alone.known, alone.not_sweepable, alone.names.found_names)

    def enter(self, scope: Scope) -> None:
        """Enter them in the scope of a run."""
        scope.parameters |= self.parameters
        scope.auxiliary |= self.auxiliary
        for path, parameters in self.known.items():
            scope.known.setdefault(path, []).extend(parameters)
        for path, why in self.not_sweepable.items():
            scope.not_sweepable.setdefault(path, why)
        scope.names.take_over(self.names)

    def has_names_as_written(self, scope: Scope) -> bool:
        """True where neither a sweep nor a setting, of a run or from outside, changes a name that they are made of."""
        changed, named, lets = {*scope.varied, *scope.settings}, self.names.named, scope.definitions.lets
        return not changed or (
            changed.isdisjoint(named)
            and not any("." in name and name not in lets for name in named)
            and not any(path.partition(".")[0] in named for path in changed)
        )
