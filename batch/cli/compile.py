"""`met compile`: a face of batch.portable."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from met.cli import YES, check_options, deck_options, format_option, loudness_options
from met.host.streams import kept
from met.messages.visible import say

if TYPE_CHECKING:
    from met.plan import Experiment


@click.command(short_help="Compile a run or sweep to WebAssembly, or to an FMU.")
@click.argument("source", metavar="DECK|PLAN.json|ARCHIVE.h5")
@click.argument("name", metavar="[NAME]", required=False)
@click.option(
    "-o", "--output", metavar="FILE.wasm|FILE.fmu", help="The module or FMU to write [NAME.wasm, in this folder]."
)
@click.option("--fmi", type=click.Choice(["2", "3"]), help="The version of FMI of an FMU, 2.0 or 3.0 [3].")
@deck_options
@format_option
@loudness_options
def compile(
    source: str,
    name: str | None,
    output: str | None,
    fmi: str | None,
    form: str,
    quiet: bool,
    verbose: bool,
    **options: Any,
) -> int:
    """Compile a deck's only run or sweep, the one marked `default`, or NAME, to a WebAssembly module, or with `-o
    FILE.fmu` to an FMU for co-simulation. Of an archive, what was run is compiled.

    Both compute the bits of `met run`, wherever they run. What a sweep varies is an input or a parameter; all else is
    constant in the code. FILE.json beside a module describes the places of inputs, recorded numbers and metrics in its
    memory, and has the inputs of the cases. Only files that this command wrote are overwritten.
    """
    import json

    from batch.portable import files
    from ic.printing.columns import count, size
    from met.outputs import path_of

    names = (name,) if name is not None else ()
    check_options(source, names, **options)
    if fmi is not None and (output is None or path_of(output).suffix != files.FMU_ENDING):
        raise click.UsageError("--fmi is for FMUs: `-o FILE.fmu` writes one")
    if output is not None:
        files.check(path_of(output))
    experiment = files.experiment_of(source, names, output, **options, quiet=quiet or form == "json")
    target = Path(f"{experiment.name}{files.ENDING}" if output is None else output)
    if output is None:
        files.check(target)
    if target.suffix == files.FMU_ENDING:
        return _compile_fmu(experiment, target, int(fmi or 3), form=form, quiet=quiet)
    done = files.write(experiment, target)
    with kept(f"{done.module} and {done.description} are whole"):
        if form == "json":
            told = {"module": str(done.module), "description": str(done.description), **done.described["kernel"]}
            click.echo(json.dumps(told, indent=1))
        elif not quiet:
            of = done.described
            numbers = (("inputs", "input"), ("columns", "recorded number"), ("metrics", "metric"))
            what = ", ".join(count(len(of[key]), name) for key, name in numbers)
            say(f"{done.module}  ({size(done.module.stat().st_size)})  {what}")
            if of["not_computed"]:
                say(
                    f"  not computed in it: {', '.join(each['name'] for each in of['not_computed'])}, of linear answers"
                )
            say(f"{done.description}  ({size(done.description.stat().st_size)})")
    return YES


def _compile_fmu(experiment: Experiment, target: Path, version: int, *, form: str, quiet: bool) -> int:
    """Write an FMU, and say what it has. version: of FMI"""
    import json

    from batch.portable import files
    from ic.printing.columns import count, size

    fmu = files.write_fmu(experiment, target, version)
    counts = {
        kind: sum(variable.kind == kind for variable in fmu.variables) for kind in ("parameter", "input", "output")
    }
    unknown = [use.name for use in experiment.linear_metrics]
    with kept(f"{target} is whole"):
        if form == "json":
            contents = {
                "fmu": str(target),
                "fmi": f"{version}.0",
                "platform": fmu.platform or None,
                **{f"{kind}s": number for kind, number in counts.items()},
                "not_computed": unknown,
            }
            click.echo(json.dumps(contents, indent=1))
        elif not quiet:
            what = ", ".join(count(number, kind) for kind, number in counts.items())
            say(f"{target}  ({size(target.stat().st_size)})  {what}")
            if unknown:
                say(f"  not computed in it: {', '.join(unknown)}, of linear answers")
            say(f"  C sources, and a binary for {fmu.platform}" if fmu.platform else "  C sources alone")
        if not fmu.platform:
            say(f"no binary in {target}: {fmu.why_none}", err=True)
    return YES
