"""Keys of a run that a plan keeps as one word or number each, all read by their declarations."""

from __future__ import annotations

from typing import Any

from ic.language import BLOCKS
from ic.meaning.definitions.merge import MergedBlock
from ic.meaning.parameters import not_sweepable
from ic.meaning.parameters.not_sweepable import NotSweepable
from ic.meaning.parameters.owner import Owner, Settled
from ic.meaning.parameters.scope import Scope
from met.plan import Origin
from met.plan.run_keys import RunKey, run_keys


def resolve_run_keys(scope: Scope, run: Owner, block: MergedBlock, cls: type) -> dict[str, Any]:
    """The fields of a plan's dataclass that keep keys of this run, by name; the default where one has a mistake, which
    is reported. Each key is settled in the scope, so that it can be explained."""
    return {field: key.in_plan(_read(scope, run, block, key)) for field, key in run_keys(cls)}


def _read(scope: Scope, run: Owner, block: MergedBlock, key: RunKey) -> Any:
    """The value of one key of a run, in SI; its default where the run does not write it."""
    wanted = key.parameter
    head, _, name = key.path.rpartition(".")
    holder = block.get(head) if head else None
    body = block if not head else (holder.body if holder is not None else None) or MergedBlock()
    item = body.get(name)
    owner = Owner(BLOCKS[head].called, item.place if item is not None else run.place, head) if head else run
    if wanted.shape == "word":
        value: Any = scope.word(owner, wanted, item)
    elif item is not None:
        value = scope.constant(owner, wanted, item)
    else:
        value = wanted.default
        scope.auxiliary[key.path] = Settled(value, wanted.unit, Origin("default"), wanted.doc)
    entry = BLOCKS[head or "run"][name]
    if entry.varies == "never":
        scope.not_sweepable[key.path] = NotSweepable("is one for the whole sweep", not_sweepable.A_RUN_FOR_EACH)
    return wanted.default if value is None else value
