"""The files of a module or an FMU: the choice of its experiment, checks of the places, and writing whole or not at
all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from batch.archive.read import ArchiveFile
from batch.campaigns.choosing import experiments_named, read_plan
from batch.fmu.package import Fmu, fmu_of, is_fmu
from batch.modules.description import FORMAT, described
from batch.portable.page import GENERATOR
from met.backends.wasm.module import compiled
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import open_regular, whole_file
from met.host.sources import names_archive, names_plan
from met.outputs import ELSEWHERE, check_ending, check_overwrite, check_place, quoted, writing
from met.plan import Experiment
from met.run import prepare

ENDING, FMU_ENDING = ".wasm", ".fmu"


@frozen
class ModuleFiles:
    """The two written files, and the contents of the second."""

    module: Path
    description: Path
    described: dict[str, Any]


def experiment_of(
    source: str, names: tuple[str, ...], output: str | None, *, quiet: bool, **options: Any
) -> Experiment:
    """The experiment of a deck, a plan file or an archive. output: where it is to be compiled to, for messages.
    options: how a deck is read, as for `batch.campaigns.choosing.read_plan`. Raises Problem."""
    if names_archive(source):
        with ArchiveFile(source) as file:
            plan = file.plan()
    else:
        plan = read_plan(source, names, **options, quiet=quiet)
    return _the_one(experiments_named(plan, names or None), source, output)


def _the_one(experiments: tuple[Experiment, ...], source: str, output: str | None) -> Experiment:
    """The experiment of a module or an FMU. Raises Problem E472 where there are several."""
    if len(experiments) == 1:
        return experiments[0]
    names = list(dict.fromkeys(experiment.name_in_deck for experiment in experiments))
    if len(names) > 1:
        helps = [f"name one: {', '.join(names)}"]
    else:
        groups = ", ".join(experiment.name for experiment in experiments)
        helps = [f"name a group: {groups}"]
        if not names_archive(source) and not names_plan(source):
            plan = f"`met plan {quoted(source)} {quoted(names[0])} -o plan.json`"
            place = "" if output is None else f" -o {quoted(output)}"
            helps = [f"{plan}, then `met compile plan.json GROUP{place}`: {groups}"]
    what = (
        f"{source} has {len(names)} runs and sweeps"
        if len(names) > 1
        else f"`{names[0]}` has {len(experiments)} structures"
    )
    raise Problem(error("E472", f"{what}, and a module or an FMU is of one", help=helps))


def check(output: Path) -> None:
    """Refuse places before anything is compiled. Raises Problem E470, or E471 where the name suits neither a module nor
    an FMU."""
    if output.suffix not in (ENDING, FMU_ENDING) and not output.is_dir():
        helps = [f"`-o {quoted(output.with_suffix(ending))}`" for ending in (ENDING, FMU_ENDING) if output.name]
        raise Problem(error("E471", f"cannot write {output}: modules are .wasm files, and FMUs .fmu files", help=helps))
    beside = output.parent / f"{output.stem}.json"
    module = ((output, _is_module), (beside, _is_description))
    inside = output / ("arm.fmu" if output.suffix == FMU_ENDING else "module.wasm")
    for path, own in ((output, is_fmu),) if output.suffix == FMU_ENDING else module:
        with writing(path, code="E470", help=ELSEWHERE):
            check_place(path, code="E470", inside=inside)
            check_overwrite(path, own, code="E470", because=" and was not written by `met compile`")


def write(experiment: Experiment, output: Path) -> ModuleFiles:
    """Compile an experiment to `output`, and describe it in the .json file beside it. Raises Problem E470."""
    prepared = prepare(experiment)
    module = compiled(prepared.recording)
    description = described(prepared, module)
    text = json.dumps(description, indent=1, allow_nan=False) + "\n"
    beside = output.with_suffix(".json")
    for path, data in ((output, module.code), (beside, text.encode())):
        _write(path, data, "E470")
    return ModuleFiles(output, beside, description)


def write_fmu(experiment: Experiment, output: Path, version: int) -> Fmu:
    """Write the FMU of an experiment. version: of FMI. Raises Problem E470."""
    fmu = fmu_of(experiment, version)
    _write(output, fmu.data, "E470")
    return fmu


def _write(path: Path, data: bytes, code: str) -> None:
    """Write a file, whole or not at all. Raises a Problem of this code where that cannot be."""
    with writing(path, code=code, help=ELSEWHERE), whole_file(path) as file:
        file.write(data)


def check_page(output: Path) -> None:
    """Refuse a place for a page before anything is computed. Raises Problem E474, E475."""
    check_ending(output, (".html", ".htm"), code="E475", kinds="pages are HTML files")
    with writing(output, code="E474", help=ELSEWHERE):
        check_place(output, code="E474", inside=output / "view.html")
        check_overwrite(output, _is_page, code="E474", because=" and was not written by `met view`")


def write_page(text: str, output: Path) -> None:
    """Write the page under its name, whole or not at all. Raises Problem E474."""
    _write(output, text.encode(), "E474")


def _is_page(path: Path) -> bool:
    with open_regular(path) as file:
        return f'<meta name="generator" content="{GENERATOR}">'.encode() in file.read(400)


def _is_module(path: Path) -> bool:
    with open_regular(path) as file:
        return file.read(4) == b"\0asm"


def _is_description(path: Path) -> bool:
    with open_regular(path) as file:
        return f'"format": "{FORMAT}"'.encode() in file.read(100)
