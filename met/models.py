"""Models by kind and name: MET's own tuples, and the entry points of other installed packages.

A package of your own offers a model by an entry point in one of the groups below, whose object is the declaration:

    [project.entry-points."met.servos"]
    harmonic_drive = "my_arm.harmonic_drive:SERVO"

Names are unique over all packages: MET's own are found first, and whenever other packages are looked through, two that
offer the same name are an error, never a race.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache
from importlib import import_module
from typing import Any, Literal, Protocol

from met.diagnostic import Place, Problem, did_you_mean, error
from met.frozen import frozen
from met.host.entry_points import offered
from met.parameter import Parameter
from met.unit_parser import parse_unit

Kind = Literal["servo", "sensor", "environment", "command", "guide", "metric", "integrator", "bed", "law"]


OF_ONES_OWN = (
    "a model of your own is known once its package is installed, `pip install -e FOLDER`; `met new` writes "
    "such a package"
)

HELD = ("memory", "outputs", "integrals", "states", "signals")
"""Fields of declarations that list the numbers which a model holds and shows."""

FAULTS = "faults"
"""The parameter of a bed that a deck writes as a word: the name of a preset."""


class Model(Protocol):
    """The fields that all declarations share."""

    @property
    def name(self) -> str:
        """The name by which decks ask for it."""

    @property
    def doc(self) -> str:
        """Its description, a sentence."""


@frozen
class ModelGroup:
    """One kind of model: the group of entry points, and MET's module with its own models and the type of a declaration.

    The module is imported when its models are asked for.
    """

    entry_points: str
    module: str
    models: str
    declaration: str

    def own(self) -> tuple[Iterable[Any], type]:
        """MET's own declarations of this kind, and the type that all of them have."""
        module = import_module(self.module)
        return getattr(module, self.models), getattr(module, self.declaration)


GROUPS: dict[Kind, ModelGroup] = {
    "servo": ModelGroup("met.servos", "met.servos", "SERVOS", "Servo"),
    "sensor": ModelGroup("met.sensors", "met.sensors", "SENSORS", "Sensor"),
    "environment": ModelGroup("met.environments", "met.environments", "ENVIRONMENTS", "Environment"),
    "command": ModelGroup("met.profiles", "met.commands", "PROFILES", "Profile"),
    "guide": ModelGroup("met.guides", "met.guides", "GUIDES", "Guide"),
    "metric": ModelGroup("met.metrics", "met.metrics", "METRICS", "Metric"),
    "integrator": ModelGroup("met.integrators", "met.integrators", "INTEGRATORS", "Integrator"),
    "bed": ModelGroup("met.beds", "met.substitution", "BEDS", "BedModel"),
    "law": ModelGroup("met.laws", "met.substitution", "LAWS", "Law"),
}


@cache
def available(kind: Kind) -> dict[str, Any]:
    """Every model of this kind by name: MET's own first, then those of other packages, by name.

    Raises Problem E215 where a package offers something that is not a declaration, or a name that is taken.
    """
    group = GROUPS[kind]
    own, declaration = group.own()
    by_name: dict[str, Any] = {model.name: model for model in own}
    for point in offered(group.entry_points):
        found_at = f"entry point `{point.name} = {point.value}` of {point.package} in group `{group.entry_points}`"
        try:
            loaded = point.load()
        except KeyboardInterrupt:
            raise
        except BaseException as reason:  # another package's code: whatever it raises, `sys.exit` too, is its user's
            message = f"cannot load the {kind} of {found_at}: {type(reason).__name__}: {reason}"
            raise Problem(error("E215", message, help="mend or uninstall the package that offers it")) from reason
        if not isinstance(loaded, declaration):
            message = f"{found_at} is a {type(loaded).__name__}, not a {declaration.__module__}.{declaration.__name__}"
            raise Problem(error("E215", message, help=f"let it name the {declaration.__name__} that the file declares"))
        model: Any = loaded
        _check_names(kind, model, found_at)
        _check_units(model, found_at)
        if kind == "bed":
            _check_bed(model, found_at)
        if kind == "law":
            _check_law(model, found_at)
        if model.name in by_name and by_name[model.name] is not model:
            message = f"{found_at} offers {kind} `{model.name}`, which exists already"
            raise Problem(error("E215", message, help="give the model another name"))
        by_name[model.name] = model
    return by_name


def _check_names(kind: Kind, model: Any, found_at: str) -> None:
    """Raise Problem where two names of a model's numbers are equal, or one is the engine's: each is recorded under its
    name."""
    if kind in ("bed", "law"):
        taken = [name for name, *_ in _of_engine(kind, model)]
    else:
        taken = ["command"]
    held = [part.name for group in HELD for part in getattr(model, group, ())]
    parameters = [*getattr(model, "parameters", ()), *getattr(model, "of_joint", ())]
    for names in ([*taken, *held], distinct_names(parameters)):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            message = f"{found_at} declares `{twice[0]}` twice"
            raise Problem(error("E215", message, help="each memory, state, signal and parameter has its own name"))


def _of_engine(kind: Kind, model: Any) -> tuple[tuple[str, str, str], ...]:
    """Name, unit and meaning of the numbers that the engine holds for a motor bed, or for its law, besides its own
    memory."""
    if kind == "bed":
        from met.substitution.bed import of_bed

        return of_bed(model.drive)
    from met.substitution.law import OF_LAW, OF_OBSERVER

    return OF_LAW + OF_OBSERVER


def distinct_names(parameters: Sequence[Parameter]) -> list[str]:
    """Names of parameters; a name that appears several times, under different words of one parameter, is listed
    once."""
    names: list[str] = []
    for n, own in enumerate(parameters):
        others = [other for other in parameters[:n] if other.name == own.name]
        apart = own.only is not None and all(
            other.only is not None and other.only[0] == own.only[0] and not {*other.only[1]} & {*own.only[1]}
            for other in others
        )
        names += [] if others and apart else [own.name]
    return names


def _check_units(model: Any, found_at: str) -> None:
    """Check that every declared unit can be read."""
    words = {word: parse_unit("1") for word in ("joint", "effort", "command", "of")}
    if getattr(model, "measures", None) is not None:
        try:
            parse_unit(model.unit)
        except ValueError as reason:
            message = f"{found_at} measures something with {reason}"
            raise Problem(error("E215", message, help="give its `unit`, as decks write it: `m/s^2`")) from None
    for part in (p for group in ("parameters", "of_joint", *HELD) for p in getattr(model, group, ())):
        try:
            parse_unit(part.unit, words)
        except ValueError as reason:
            message = f"{found_at} declares `{part.name}` with {reason}"
            help = "units are those of decks, and joint, effort, command, of"
            raise Problem(error("E215", message, help=help)) from None


def _check_bed(model: Any, found_at: str) -> None:
    """Check that a motor bed's model declares the parameters that laws and the wire read by name
    (met/substitution/bed.py)."""
    from met.substitution.bed import check

    wrong = check(model)
    if wrong is None and model.presets and not any(p.name == FAULTS and p.shape == "text" for p in model.parameters):
        wrong = f"has presets, and no parameter `{FAULTS}` that names one", 'declare `faults` with `shape="text"`'
    if wrong is not None:
        message, help = wrong
        raise Problem(error("E215", f"{found_at} {message}", help=help))


def _check_law(model: Any, found_at: str) -> None:
    """Check that a law declares the parameters that its observer, and a balance with friction, read by name."""
    from met.substitution.law import BAND, OBSERVER

    needed = [(name, "with an observer") for name in OBSERVER if model.observer]
    needed += [(BAND, "of full balance")] if model.balance == "full" else []
    for parameter, kind in needed:
        if all(declared.name != parameter.name for declared in model.parameters):
            message = f"{found_at} declares no parameter `{parameter.name}`, which every law {kind} has"
            help = f"`{parameter.name}`, {parameter.unit}: {parameter.doc}"
            raise Problem(error("E215", message, help=help))


def find(kind: Kind, name: str, place: Place | None = None) -> Any:
    """The model of this kind and name. Raises Problem D140, placed, with the name that was probably meant."""
    models = find_own(kind)
    if name in models:
        return models[name]
    models = available(kind)
    if name in models:
        return models[name]
    near = did_you_mean(name, models)
    helps = [*near, f"{kind} models: {', '.join(sorted(models))}", *([] if near else [OF_ONES_OWN])]
    raise Problem(error("D140", f"no {kind} model `{name}`", place, help=helps))


def find_own(kind: Kind) -> dict[str, Any]:
    """MET's own models of this kind by name, found without loading other packages."""
    return {model.name: model for model in GROUPS[kind].own()[0]}


def written(model: Any) -> tuple[Parameter, ...]:
    """The parameters in the form in which a deck writes them, where it differs from a plan's.

    Of a profile from a file its name stands for the rows; a bed's `faults` is a word, one of its presets.
    """
    parameters: tuple[Parameter, ...] = getattr(model, "written", getattr(model, "parameters", ()))
    presets = tuple(getattr(model, "presets", ()))
    return tuple(replace(p, shape="word", words=presets) if presets and p.name == FAULTS else p for p in parameters)


def has_motor(servo: Any) -> bool:
    """True where a motor bed may replace this servo's motor: the servo has one, and its computer sets the voltage."""
    return servo.motor is not None and any(output.name == "voltage" for output in servo.outputs)


def parameter(model: Any, name: str) -> Parameter | None:
    """The declared parameter of this name, None where there is none."""
    return next((p for p in (*model.parameters, *getattr(model, "of_joint", ())) if p.name == name), None)
