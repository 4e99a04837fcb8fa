"""`met compile`: a face of batch.portable."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from met.cli import YES, check_options, deck_options, format_option, loudness_options
from met.host.streams import kept
from met.messages.visible import say


@click.command(short_help="Compile a run or sweep to WebAssembly, for pages and node.")
@click.argument("source", metavar="DECK|PLAN.json|ARCHIVE.h5")
@click.argument("name", metavar="[NAME]", required=False)
@click.option("-o", "--output", metavar="FILE.wasm", help="The module to write [NAME.wasm, in this folder].")
@deck_options
@format_option
@loudness_options
def compile(
    source: str,
    name: str | None,
    output: str | None,
    form: str,
    quiet: bool,
    verbose: bool,
    **options: Any,
) -> int:
    """Compile a deck's only run or sweep, the one marked `default`, or NAME, to a WebAssembly module. Of an archive,
    what was run is compiled.

    The module computes the bits of `met run`, wherever it runs. FILE.json beside it describes the places of inputs,
    recorded numbers and metrics in its memory, and has the inputs of the cases. What a sweep varies is an input; all
    else is constant in the code. Only files that this command wrote are overwritten.
    """
    import json

    from batch.portable import files
    from ic.printing.columns import size
    from met.outputs import path_of

    names = (name,) if name is not None else ()
    check_options(source, names, **options)
    if output is not None:
        files.check(path_of(output))
    experiment = files.experiment_of(source, names, **options, quiet=quiet or form == "json")
    target = Path(f"{experiment.name}{files.ENDING}" if output is None else output)
    if output is None:
        files.check(target)
    done = files.write(experiment, target)
    with kept(f"{done.module} and {done.description} are whole"):
        if form == "json":
            told = {"module": str(done.module), "description": str(done.description), **done.described["kernel"]}
            click.echo(json.dumps(told, indent=1))
        elif not quiet:
            of = done.described
            what = f"{len(of['inputs'])} inputs, {len(of['columns'])} recorded numbers, {len(of['metrics'])} metrics"
            say(f"{done.module}  ({size(done.module.stat().st_size)})  {what}")
            if of["not_computed"]:
                say(
                    f"  not computed in it: {', '.join(each['name'] for each in of['not_computed'])}, of linear answers"
                )
            say(f"{done.description}  ({size(done.description.stat().st_size)})")
    return YES
