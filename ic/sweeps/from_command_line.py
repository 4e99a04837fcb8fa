"""The sweep of `--vary`, made as if the deck contained `sweep RUN_varied of RUN { vary PATH = VALUES; ... }`."""

from __future__ import annotations

from collections.abc import Sequence

from ic.grammar.syntax import Group, Name, Setting, Word
from ic.language import EXPERIMENTS
from ic.meaning.definitions.resolve import Definition, Definitions
from ic.text.complaints import known_words, with_article
from met.diagnostic import Label, Problem, error, write
from met.outputs import varied_name


def command_line_sweep(
    definitions: Definitions, requested: Sequence[Definition], entries: tuple[Setting, ...]
) -> Definition:
    """The sweep of the requested run over these entries, `vary PATH = VALUES`. Raises Problem D288."""
    place = entries[0].place
    runs = list(definitions.of_kind("run"))
    if len(requested) != 1:
        message = f"`--vary` varies one run, and {len(requested)} are asked for"
        also = [Label(definition.place, f"`{definition.name}`") for definition in requested]
        raise Problem(error("D288", message, place, also=also, help=known_words("name one", runs)))
    (run,) = requested
    if run.kind != "run":
        message = f"`--vary` varies a run, and `{run.name}` is {with_article(run.kind)}"
        base = run.group.of.text if run.group.of is not None else None
        helps = [write(base, f"name the run that it is of: `{base}`", old=run.name)] if base in runs else []
        also = [Label(run.place, "defined here")]
        raise Problem(error("D288", message, place, also=also, help=helps or known_words("name a run", runs)))
    taken = [name for kind in EXPERIMENTS for name in definitions.of_kind(kind)]
    words = (Word("sweep", place), Word(varied_name(run.name, taken), place))
    group = Group(words, None, Name((Word(run.name, place),), place), entries, place)
    return Definition("sweep", words[1].text, group)
