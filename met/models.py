"""Where models are found: MET's own tuples, and the entry points of other installed packages.

A package of your own offers a model by an entry point in one of the groups below, whose object is the declaration:

    [project.entry-points."met.servos"]
    harmonic_drive = "my_arm.harmonic_drive:SERVO"

Names are unique over all packages: MET's own are found first, and whenever other packages are looked through, two that
offer the same name are an error, never a race.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import cache
from typing import Any, Literal, Protocol

from met import units
from met.diagnostic import Place, Problem, did_you_mean, error
from met.entry_points import offered
from met.frozen import frozen
from met.parameter import Parameter

Kind = Literal["servo", "environment", "command", "metric", "integrator"]


class Model(Protocol):
    """What all declarations have."""

    @property
    def name(self) -> str: ...
    @property
    def doc(self) -> str: ...


@frozen
class Group:
    """One kind of model: the entry-point group, MET's own declarations, and the type they must have."""

    entry_points: str
    own: Callable[[], tuple[Iterable[Any], type]]


def _servos() -> tuple[Iterable[Any], type]:
    from met.servos import SERVOS, Servo

    return SERVOS, Servo


def _environments() -> tuple[Iterable[Any], type]:
    from met.environments import ENVIRONMENTS, Environment

    return ENVIRONMENTS, Environment


def _commands() -> tuple[Iterable[Any], type]:
    from met.commands import PROFILES, Profile

    return PROFILES, Profile


def _metrics() -> tuple[Iterable[Any], type]:
    from met.metrics import METRICS, Metric

    return METRICS, Metric


def _integrators() -> tuple[Iterable[Any], type]:
    from met.integrators import INTEGRATORS, Integrator

    return INTEGRATORS, Integrator


GROUPS: dict[Kind, Group] = {
    "servo": Group("met.servos", _servos),
    "environment": Group("met.environments", _environments),
    "command": Group("met.profiles", _commands),
    "metric": Group("met.metrics", _metrics),
    "integrator": Group("met.integrators", _integrators),
}


@cache
def available(kind: Kind) -> dict[str, Any]:
    """Every model of this kind by name: MET's own first, then those of other packages, by name.

    Raises Problem E215 where a package offers something that is not a declaration, or a name that is taken.
    """
    group = GROUPS[kind]
    own, declaration = group.own()
    found: dict[str, Any] = {model.name: model for model in own}
    for point in offered(group.entry_points):
        found_at = f"entry point `{point.name} = {point.value}` of {point.package} in group `{group.entry_points}`"
        try:
            loaded = point.load()
        except Exception as reason:  # another package's code: whatever it raises is its user's to read
            message = f"cannot load the {kind} of {found_at}: {type(reason).__name__}: {reason}"
            raise Problem(error("E215", message, help="mend or uninstall the package that offers it")) from reason
        if not isinstance(loaded, declaration):
            message = f"{found_at} is a {type(loaded).__name__}, not a {declaration.__module__}.{declaration.__name__}"
            raise Problem(error("E215", message, help=f"let it name the {declaration.__name__} that the file declares"))
        model: Any = loaded
        _check_names(model, found_at)
        _check_units(model, found_at)
        if model.name in found and found[model.name] is not model:
            message = f"{found_at} offers {kind} `{model.name}`, which exists already"
            raise Problem(error("E215", message, help="give the model another name"))
        found[model.name] = model
    return found


def _check_names(model: Any, found_at: str) -> None:
    """What a model holds and shows is recorded under its name, so names are apart; `command` is the engine's."""
    shown = [part.name for group in ("memory", "states", "signals") for part in getattr(model, group, ())]
    for names in (["command", *shown], [parameter.name for parameter in getattr(model, "parameters", ())]):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            message = f"{found_at} declares `{twice[0]}` twice"
            raise Problem(error("E215", message, help="each memory, state, signal and parameter has its own name"))


def _check_units(model: Any, found_at: str) -> None:
    """Every declared unit can be read."""
    words = {word: units.parse_unit("1") for word in ("joint", "effort", "command", "of")}
    for part in (p for group in ("parameters", "memory", "states", "signals") for p in getattr(model, group, ())):
        try:
            units.parse_unit(part.unit, words)
        except ValueError as reason:
            message = f"{found_at} declares `{part.name}` with {reason}"
            help = "units are those of decks, and joint, effort, command, of"
            raise Problem(error("E215", message, help=help)) from None


def find(kind: Kind, name: str, place: Place | None = None) -> Any:
    """The model of this kind and name. Raises Problem D140, placed, with what was probably meant."""
    models = find_own(kind)
    if name in models:
        return models[name]
    models = available(kind)
    if name in models:
        return models[name]
    helps = [*did_you_mean(name, models), f"{kind} models: {', '.join(sorted(models))}"]
    raise Problem(error("D140", f"no {kind} model `{name}`", place, help=helps))


def find_own(kind: Kind) -> dict[str, Any]:
    """MET's own models of this kind by name: found without loading what other packages offer."""
    return {model.name: model for model in GROUPS[kind].own()[0]}


def parameter(model: Any, name: str) -> Parameter | None:
    """The declared parameter of this name, None where there is none."""
    return next((p for p in model.parameters if p.name == name), None)
