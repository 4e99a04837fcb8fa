"""`met sensitivity`: a face of batch.queries.sensitivity."""

from __future__ import annotations

import click

from met.cli import YES, format_option
from met.messages.visible import line, say


@click.command(short_help="Show which varied parameters explain a metric, a failure, or a change.")
@click.argument("archive", metavar="ARCHIVE")
@click.argument("metrics", nargs=-1, metavar="[METRIC]...")
@click.option("--run", "experiments", multiple=True, metavar="NAME", help="Only this run or sweep of the archive.")
@click.option("--against", metavar="BEFORE.h5", help="Explain the change of each metric since this archive.")
@format_option
def sensitivity(
    archive: str, metrics: tuple[str, ...], experiments: tuple[str, ...], against: str | None, form: str
) -> int:
    """Rank the varied parameters by the share of each METRIC's variance that they explain: of all metrics by default,
    and of `failure` if some cases fail.

    The first-order index is the share of a parameter alone. The total index adds its share with others, as far as two
    inputs act together. Both have 95 % intervals. Any cases will do whose parameters vary independently; those of
    `sample saltelli(n)` are used with the estimators that they are made for.
    """
    import json
    from contextlib import ExitStack

    from batch.archive.read import ArchiveFile
    from batch.differences.matching import match_cases, match_experiments
    from batch.queries.pool import groups_named
    from batch.queries.sensitivity import sensitivities
    from batch.terminal.sensitivity import as_data, sensitivity_lines
    from met.diagnostic import Problem, error

    data, texts = [], []
    with ExitStack() as files:
        file = files.enter_context(ArchiveFile(archive))
        file.need_every_row("what a result depends on")
        groups = groups_named(file, experiments)
        pairs = {}
        if against is not None:
            other = files.enter_context(ArchiveFile(against))
            other.need_every_row("what a change depends on")
            both, _, _ = match_experiments(other, file)
            for group_a, group_b in both:
                matched = match_cases(group_a, group_b)
                pairs[group_b.name] = (group_a, matched.a, matched.b)
        for group in groups:
            if against is not None and group.name not in pairs:
                helps = "name one that both have: `--run NAME`"
                raise Problem(error("E361", f"no cases of `{group.name}` are in {against}", help=helps))
            results = sensitivities(group, metrics, pairs.get(group.name))
            data.append({"experiment": group.name, "outputs": [as_data(result) for result in results]})
            texts.append("\n\n".join("\n".join(map(line, sensitivity_lines(result))) for result in results))
            if len(groups) > 1:
                texts[-1] = f"{line(group.name)}\n\n{texts[-1]}"
    say(json.dumps(data, indent=1) if form == "json" else "\n\n".join(texts))
    return YES
