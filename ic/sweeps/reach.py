"""The reach of a sweep's coordinates: the parameters that each sets, and a check that each sets something."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ic.meaning.parameters.scope import Scope
from ic.sweeps.axes import Sweep
from ic.sweeps.choices import ONE_OF_TWO
from ic.text.complaints import Complaints, known_words
from met import units
from met.analysis.memo import AnalysisMemo
from met.diagnostic import Label, leave_out, meant, write
from met.plan import REPEAT, SEED, Coordinate, Experiment
from met.plan.columns import CaseValues


def check_coordinates(scope: Scope, *, complete: bool) -> None:
    """Check that every coordinate sets something.

    complete  all of the run was resolved; else nothing is said of what hangs on the rest, reported already
    """
    for path, varied in scope.varied.items():
        if path in scope.targets or path in scope.names.followed or scope.depends_on_failed(path):
            continue
        unknown = path in scope.definitions.lets or path.startswith("metrics.") or not scope.known
        if unknown and (not complete or scope.failed_parts or scope.failed_servos):
            continue
        place = varied.place
        if path in scope.not_sweepable:
            why = scope.not_sweepable[path]
            of_run = path.partition(".")[2] if path.partition(".")[0] in scope.definitions.of_kind("run") else ""
            own = of_run if of_run in scope.not_sweepable else path  # which a sweep chooses without the run's name
            scope.complaints.error(
                "D122", f"`{path}` cannot vary{' like this' if why.is_choice else ''}", place, help=why.to_vary(own)
            )
            continue
        first, *words = scope.definitions.split(path)
        rest = ".".join(words)
        if path in ("integrator", "arm", "base") or rest in ("servo", "law", "bed", "servo.model", "servo.command"):
            scope.complaints.error(
                "D122",
                f"`{path}` cannot vary over numbers",
                place,
                help=f"it varies over names: `vary {path} = [...];`",
            )
            continue
        also = _overridden(scope, first, rest)
        if first in ("rates", "duration", "record", "servos") or path in ONE_OF_TWO:
            scope.complaints.error(
                "D122", f"`{path}` cannot vary", place, help="vary one of its parts, or what it names"
            )
        elif also is not None:
            scope.complaints.error(
                "D137",
                f"`{path}` changes nothing in this run",
                place,
                also=also,
                help="every use overrides it, or the run does not use it; vary it where it is overridden",
            )
        else:
            scope.complaints.error(
                "D128",
                f"no parameter `{path}` in this run",
                place,
                help=scope.definitions.stays_away(path)
                or no_scale(path)
                or _probably_meant(scope, path)
                or parameters_nearby(scope, path)
                or paths_ending_in(scope, path)
                or first_words(scope),
            )


def _probably_meant(scope: Scope, path: str) -> Sequence[str]:
    """The remedy that names the path without a first word too many, else a similar one; and what of it varies."""
    known = (*scope.known, *scope.not_sweepable, *scope.definitions.lets)
    rest = path.partition(".")[2]
    near = rest if "." in rest and rest in known else meant(path, known)
    why = scope.not_sweepable.get(near or "")
    if near is not None and why is not None and not why.is_choice:
        return [f"did you mean `{near}`? {why.to_vary(near)}"]
    return (write(near, f"did you mean `{near}`?", old=path),) if near is not None else ()


def _overridden(scope: Scope, first: str, rest: str) -> list[Label] | None:
    """Places of an existing value of a definition or a let that no parameter of the run takes."""
    let = scope.definitions.lets.get(first)
    if let is not None and not rest:
        return [Label(let.name.place, "defined here")]
    definition = scope.definitions.of_kind("servo").get(first)
    block = scope.definitions.block(definition) if definition is not None else None
    item = block.get(rest) if block is not None else None
    return [Label(item.place, "written here")] if item is not None else None


def no_scale(path: str) -> list[str]:
    """The remedy for a path into a motor bed's `scale` where the bed has none."""
    joint, separator, _ = path.partition(".bed.scale.")
    return [f"its bed has no scale: `scale {{ }}` in `substitute {joint}` gives it one"] if separator else []


def first_words(scope: Scope) -> list[str]:
    """The remedy that lists the first words of paths of this run."""
    return [known_words("paths begin with", dict.fromkeys(known.partition(".")[0] for known in scope.known))]


def paths_ending_in(scope: Scope, path: str) -> list[str]:
    """The remedy that lists parameters with this last word: `kp` where `motor.kp` was meant."""
    paths = [known for known in scope.known if known.endswith(f".{path}")]
    return [known_words(f"there is `{path}` of", (known.removesuffix(f".{path}") for known in paths))] if paths else []


def parameters_nearby(scope: Scope, path: str) -> list[str]:
    """Parameters of the thing that the path's first words name, where they name one."""
    parts = path.split(".")
    for length in range(len(parts) - 1, 0, -1):
        head = ".".join(parts[:length]) + "."
        inside = sorted(known for known in scope.known if known.startswith(head))
        if inside:
            return [known_words(f"parameters of `{head[:-1]}`", inside)]
    return []


def plan_coordinates(
    scope: Scope,
    sweep: Sweep,
    columns: dict[str, CaseValues],
    dependents: dict[str, list[str]],
) -> tuple[Coordinate, ...]:
    """The coordinates in a plan's form. dependents: parameters whose formulas need each coordinate"""
    coordinates, designs = [], sweep.designs
    for varied in sweep.varied:
        direct = [path for path in scope.targets.get(varied.path, ()) if path in scope.parameters]
        unit = varied.unit.text if varied.unit is not None else units.text(varied.value.dimension)
        coordinates.append(
            Coordinate(
                varied.path,
                unit,
                varied.scale,
                columns[varied.path],
                tuple(direct or dependents.get(varied.path, ())),
                varied.place,
                designs.get(varied.path, ""),
            )
        )
    return tuple(coordinates)


def without_effect(experiment: Experiment, memo: AnalysisMemo | None = None) -> tuple[str, ...]:
    """Inputs of the experiment's program without effect. Raises Problem where a model cannot be recorded."""
    from met.analysis.audit import idle_inputs

    return idle_inputs(experiment, memo)


def has_noise(experiment: Experiment) -> bool:
    """Return True if the numbers of a case depend on the seed of its noise."""
    return SEED not in without_effect(replace(experiment, cases=replace(experiment.cases, seeds="independent")))


def check_effects(complaints: Complaints, sweep: Sweep, experiment: Experiment, memo: AnalysisMemo) -> None:
    """Check that every coordinate changes something in the program, and so do repeats: otherwise cases would silently
    be equal."""
    if not experiment.cases.coordinates and not experiment.cases.noise:
        return
    places = {varied.path: varied.place for varied in sweep.varied}
    with complaints.gather():
        for name in memo.answer("idle inputs", experiment, lambda: without_effect(experiment, memo)):
            if name in places:
                complaints.error(
                    "D137",
                    f"`{name}` changes nothing in this run",
                    places[name],
                    help=leave_out("nothing that the run computes depends on it: leave it out"),
                )
            elif name == REPEAT:
                complaints.error(
                    "D230",
                    "there is no noise in this run, so a repeat is the same case again",
                    sweep.repeated,
                    help=[
                        leave_out("leave `repeat` out"),
                        "a sensor may be noisy: `sensor qd = tachometer { noise = 0.1 rad/s; }` in a servo",
                        "and so may a bed: `substitute JOINT { bed = emulated(faults = typical); }`",
                    ],
                )
            elif REPEAT not in experiment.cases.noise:
                complaints.error(
                    "D230",
                    "there is no noise in this run, so no case has noise of its own",
                    sweep.independent,
                    help=leave_out("leave `seeds` out"),
                )
