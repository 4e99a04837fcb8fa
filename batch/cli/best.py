"""`met best`: a face of batch.queries.best."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import click

from met.cli import NO, YES, FiniteRange, format_option
from met.host.streams import kept
from met.messages.visible import line, say
from met.plan.searches import LEAST_MARGIN

if TYPE_CHECKING:
    from batch.terminal.chosen_deck import ChosenDeck


@click.command(short_help="Choose the best of the designs of a sweep.")
@click.argument("archive", metavar="ARCHIVE")
@click.option("--run", "experiment", metavar="NAME", help="The sweep, if the archive holds several.")
@click.option(
    "--over",
    multiple=True,
    metavar="PATH",
    help="A parameter that is not chosen: a design must withstand all of its values.",
)
@click.option(
    "--choose",
    multiple=True,
    metavar="PATH",
    help="A parameter that is chosen, although it is drawn at random, or one of a link, a payload, ...",
)
@click.option(
    "--by",
    multiple=True,
    metavar="METRIC",
    help="Prefer the smallest METRIC, or expression of metrics, in the worst case; METRIC:largest prefers the "
    "largest, which is the default for margins; METRIC:smallest. Repeated: equal designs by the next one. "
    "Without it: the design that is farthest from missing a requirement.",
)
@click.option(
    "--front", multiple=True, metavar="METRIC", help="Also show the trade-off between two such metrics: name each."
)
@click.option(
    "--least-margin",
    type=FiniteRange(0.0, 2.0, max_open=True),
    metavar="ALPHA",
    help="The disk margin of its servo loops below which a design is not advised: 0.3 is 1.35 times the gain, 0.67 "
    f"twice; 0 judges none.  [{LEAST_MARGIN}]",
)
@click.option("--diff", is_flag=True, help="Show what --write would change in the deck's text.")
@click.option("--write", is_flag=True, help="Write the chosen values into the deck's text, and show what changed.")
@click.option(
    "-o", "output", metavar="FILE", help="With --diff or --write: a new file, for a changed copy of the deck."
)
@format_option
def best(
    archive: str,
    experiment: str | None,
    over: tuple[str, ...],
    choose: tuple[str, ...],
    by: tuple[str, ...],
    front: tuple[str, ...],
    least_margin: float | None,
    diff: bool,
    write: bool,
    output: str | None,
    form: str,
) -> int:
    """Choose the best design of a sweep: the values of its axes (`vary`, `zip`, `from`) with which all requirements are
    met in all cases that the design must withstand, and with the largest distance from missing one.

    For a search or a tuning, the command prints its answer.

    A design must withstand the values that are drawn at random, those of links, payloads, the environment and the
    initial state, and those that --over names.

    --write puts the chosen values into the deck that was swept, where the old ones stand or as entries of their
    definitions, after it is proved that the run means the same as with --set.

    The stability of its servo loops is judged in its cases, at poses that they pass: a design whose margin is less than
    --least-margin is not advised, and the best that keeps it is chosen.

    Exit status: 0 a design meets all requirements and keeps the margin; 1 none does; 2 the input is wrong.
    """
    import shutil

    from batch.archive.read import ArchiveFile
    from batch.archive.searched import search_of
    from batch.campaigns.judging import judged_best
    from batch.queries.best import Designs
    from batch.queries.best_answer import BestAnswer
    from batch.queries.given import context
    from batch.queries.pool import groups_named, pools
    from batch.queries.search_answers import search_result
    from batch.queries.summary import finite
    from batch.terminal.chosen_deck import chosen_deck
    from met.diagnostic import Problem, error
    from met.outputs import quoted

    with ArchiveFile(archive) as file:
        file.need_every_row("choosing among designs")
        pools_ = pools(groups_named(file, [experiment] if experiment else []))
        pools_ = [pool for pool in pools_ if pool.count > 1 or search_of(pool.groups[0]) is not None]
        if not pools_:
            helps = "a sweep has several: `vary`, `sample`"
            raise Problem(error("E395", f"{archive} has no designs to choose among: each run is one case", help=helps))
        if len(pools_) > 1:
            helps = f"name one: {', '.join(f'`--run {pool.name}`' for pool in pools_)}"
            raise Problem(error("E395", f"{archive} holds several sweeps", help=helps))
        pool = pools_[0]
        searched = search_result(file, pool.groups[0])
        if output is not None and not (diff or write):
            raise click.UsageError("-o is the file for --write")
        if searched is not None:
            if over or choose or by or front or least_margin is not None:
                message = (
                    f"`{pool.name}` is a search, whose cases it chose itself: nothing but its answer follows from them"
                )
                helps = (
                    f"`met best {quoted(archive)}` says it; a sweep over what it chooses has all cases of each design"
                )
                raise Problem(error("E395", message, help=helps))
            if (diff or write) and not searched.tunes:
                message = f"`{pool.name}` looks for the case that hurts most, which is nothing to write into a deck"
                raise Problem(error("E395", message, help="a `tune` chooses values that are"))
            deck = None
            if (diff or write) and searched.ok:
                deck = chosen_deck(file, searched.values, output, experiment=searched.name, among=searched.among)
            tell(form, finite(searched.data), searched.lines, deck, requested=diff or write, write=write)
            return YES if searched.ok else NO
        designs = Designs(pool, over, choose)
        if not pool.requirements and not by:
            metrics = ", ".join(column.label for column in pool.metrics())
            helps = f"`--by METRIC`: {metrics}" if metrics else "give its run a metric, and require something of it"
            raise Problem(error("E396", f"nothing says which design of `{pool.name}` is better", help=helps))
        if len(front) == 1:
            raise click.UsageError("--front is of two: name each, `--front settle --front over`")
        goals, traded = ([designs.goal(text) for text in texts] for texts in (by, front))
        least = LEAST_MARGIN if least_margin is None else least_margin
        judged = judged_best(file, designs, designs.order(goals), least)
        answer = BestAnswer(designs, goals, traded, **context(file, pool), judged=judged, least_margin=least)
        deck = None
        if (diff or write) and answer.best is not None and answer.advised:
            among = f"{designs.count:,} designs"
            deck = chosen_deck(file, list(answer.values(answer.best)), output, experiment=answer.name, among=among)
        width = min(100, shutil.get_terminal_size((100, 24)).columns)
        data = answer.as_data() if form == "json" else {}
        tell(form, data, answer.lines(width), deck, requested=diff or write, write=write)
        return YES if answer.advised else NO


def tell(
    form: str,
    data: dict[str, Any],
    lines: Iterable[str],
    deck: ChosenDeck | None,
    *,
    requested: bool,
    write: bool,
    why_not: str = "no design is advised",
) -> None:
    """Say the answer, and what changes in the deck; write it.

    data, lines  the answer for programs, and for people;  deck: None where nothing is good enough to be written
    requested    whether the deck is asked for;  why_not: why there is none, in words
    """
    import json

    if form == "json":
        if deck is not None:
            data["deck"] = {"file": str(deck.target), "diff": list(deck.diff()), "written": write}
        say(json.dumps(data, indent=1))
    else:
        say("\n".join(map(line, lines)))
        if deck is not None:
            say("\n".join(["", *map(line, deck.diff())]))
        elif requested:
            say(f"\n{why_not}, so nothing is written into the deck")
    if deck is not None and write:
        deck.write()
        if form != "json":
            with kept(f"{deck.target} is written"):
                say(line(f"{deck.target}: written; it {deck.changes()}"))
