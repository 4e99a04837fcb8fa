"""`Simulation`: a run of a deck, called from Python with values for its parameters; nothing is written."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from batch.archive.in_memory import DatasetMaker
from batch.simulation.given import (
    PATHS,
    check_room,
    columns,
    settings,
    short_repr,
    text_or_none,
    texts,
    values_in_si,
    whole,
)
from ic.driver.given_values import VariedRun, given_run
from ic.printing.columns import size as size_text
from ic.text.complaints import known_words
from met import run as engine
from met.analysis.linear import metrics as linear_metrics
from met.diagnostic import Problem, did_you_mean, error
from met.host.files import memory
from met.plan import Cases, Experiment

if TYPE_CHECKING:
    import xarray

    from batch.simulation.stepping import SteppedProgram, SteppedRun
    from met.analysis.linear.gradient import GradientProgram


@dataclass
class SimulationProgram:
    """The program of a run whose inputs are some paths, with the maker of its Datasets."""

    varied: VariedRun
    prepared: engine.Prepared
    datasets: DatasetMaker


class Simulation:
    """A run of a deck as a function: values of its parameters to results, in memory.

    sim = batch.Simulation("arm.ic")
    data = sim.run({"gearbox.kp": [0.01, 0.02, 0.03], "load": "25 kg"})      # an xarray.Dataset of three cases

    path     of the deck; or none, and its text
    run      the run's name; None: the deck's only one, else the one that it marks `default`
    defines, include_dirs, set  as `ic.compile` has them: `set={"integrator": "rk4"}` for what decides the program

    The deck is compiled here, and again when a set of paths is first given: these become inputs of a program, which is
    kept as long as the simulation is. Machine code is kept in the cache of all of MET, no other file is written.

    All methods raise met.diagnostic.Problem for mistakes that a user can correct.
    """

    def __init__(
        self,
        path: str | os.PathLike[str] | None = None,
        *,
        text: str | None = None,
        run: str | None = None,
        defines: Iterable[str] = (),
        include_dirs: Iterable[str | os.PathLike[str]] = (),
        set: Mapping[str, object] | Iterable[str] = (),
    ) -> None:
        """Read the deck and find the run. Raises TypeError unless either a path or a text is given, and Problem for a
        mistake."""
        if (path is None) == (text is None):
            raise TypeError("a deck is given by its path or by its text")
        self._deck_run = given_run(
            text_or_none(path, "path", PATHS) or "",
            text_or_none(run, "run"),
            text=text_or_none(text, "text"),
            include_dirs=texts(include_dirs, "include_dirs", "E431", '["arms"]', PATHS),
            defines=texts(defines, "defines", "E431", '["FAST=1"]'),
            settings=settings(set),
        )
        self._programs: dict[tuple[tuple[str, ...], bool], SimulationProgram] = {}
        self._stepped: dict[object, SteppedProgram] = {}
        self._gradients: dict[tuple[str, ...], GradientProgram] = {}
        self._units: dict[str, str | None] = {}

    def __repr__(self) -> str:
        return f"Simulation of `{self._deck_run.name}` in {self._deck_run.deck.file}"

    @property
    def experiment(self) -> Experiment:
        """The run as the deck has it: its parameters, in SI, with where each was written."""
        return self._deck_run.experiment

    def run(
        self,
        values: Mapping[str, Any] | None = None,
        *,
        product: bool = False,
        repeat: int = 1,
        histories: bool | str | Sequence[str] = False,
        threads: int | None = None,
    ) -> xarray.Dataset:
        """Run a case for each value, and return a Dataset as `batch.open` gives it for an archive of the same sweep.

        values     by path, as `--set` and `vary` take them: `gearbox.kp`, `elbow.servo.kp`, `links.lower.mass`, a
                   `let`. A number is in SI; a text has its unit, "25 kg"; so has anything with `magnitude` and `units`.
                   One value is for all cases, a list or array has one for each; several lists go in step
        product    True: each value of one list with each of the others, the last fastest, as axes of a sweep
        repeat     each case so often, with noise of its own, as in a sweep
        histories  signals that are kept: False for none, True for all that the run records, or their names
        threads    None: as many as there are cores
        """
        repeat = whole(repeat, "repeat", least=1)
        threads = None if threads is None else whole(threads, "threads", least=1)
        table, count = columns(self._in_si(values), product=product)
        program = self._program(table, repeat > 1)
        check_room(count * repeat, len(program.prepared.program.inputs) + len(program.prepared.outputs))
        program.varied.check(table, count)
        if repeat > 1:
            table = {path: np.repeat(column, repeat) for path, column in table.items()}
        prepared = program.prepared.with_cases(_cases(program.varied.experiment.cases, table, count, repeat))
        signals = self._signals(histories, count * repeat)
        rows = np.arange(count * repeat)
        history, outputs = linear_metrics.compute(prepared, rows, threads=threads, record=bool(signals))
        return program.datasets.dataset(prepared.experiment, engine.results(prepared, rows, history, outputs), signals)

    def gradient(
        self, values: Mapping[str, Any], *, metrics: str | Sequence[str] = (), threads: int | None = None
    ) -> xarray.Dataset:
        """The slopes of the run's metrics by each of these numbers, at these values; any number of the deck may be
        given.

        values   as `run` takes them; a list makes a case for each of its values
        metrics  names; none: all
        threads  None: as many as there are cores

        The Dataset has `value` (case, metric) and `slope` (case, metric, number) in SI, and `why_not`: where there is
        no slope, the reason (docs/linear.md).
        """
        from batch.linearized.data import to_dataset
        from met.analysis.linear.gradient import GradientProgram

        threads = None if threads is None else whole(threads, "threads", least=1)
        table, count = columns(self._in_si(values), product=False)
        check_room(count, len(table))
        program = self._program(table, False)
        program.varied.check(table, count)
        varied, key = program.varied.experiment, tuple(table)
        if key not in self._gradients:
            self._gradients[key] = GradientProgram(varied)
        experiment = replace(varied, cases=_cases(varied.cases, table, count, 1))
        names = texts(metrics, "metrics", "D379", '["settle"]')
        gradients = self._gradients[key].of(range(count), names, experiment=experiment, threads=threads)
        return to_dataset(experiment, gradients)

    def start(
        self,
        values: Mapping[str, Any] | None = None,
        *,
        commands: str | Sequence[str] | Mapping[str, str],
        record: str | Sequence[str] | None = None,
        repeat: int = 0,
    ) -> SteppedRun:
        """Begin one case that is stepped by commands from outside, in place of the deck's (`SteppedRun.step`).

        values    as `run` takes them, one each
        commands  joints whose commands are given, or by joint the kind of its command: "rate", "position", "torque" or
                  "acceleration"; of a joint without, the kind that it has in the deck
        record    channels that are seen besides q and qd: `shoulder.servo.sensor.qd`, `links.lower.position`; None:
                  what the run records
        repeat    number of the noise: another number is another noise
        """
        from batch.simulation.stepping import SteppedRun, program

        repeat = whole(repeat, "repeat", least=0)
        table, count = columns(self._in_si(values), product=False)
        if count > 1:
            raise Problem(error("E430", f"one case is stepped, and these values make {count}", help="give one each"))
        kinds = _commanded(commands, table)
        seen = None if record is None else texts(record, "record", "E432", '["tau"]')
        key = tuple(table), tuple(kinds.items()), seen, repeat > 0
        if key not in self._stepped:
            first = self._first_values(table)
            self._stepped[key] = program(self._deck_run, first, kinds=kinds, record=seen, repeated=repeat > 0)
        stepped_program = self._stepped[key]
        zeros = {path: np.zeros(1) for path in stepped_program.paths}
        stepped_program.varied.check({**table, **zeros}, 1)
        return SteppedRun(stepped_program, {**table, **zeros}, repeat)

    def _in_si(self, values: Mapping[str, Any] | None) -> dict[str, np.ndarray]:
        """Values by path in SI, one or many of each. Raises Problem E431 where they are not given by path."""
        in_si: dict[str, np.ndarray] = {}
        values = {} if values is None else values
        if not isinstance(values, Mapping) or not all(isinstance(path, str) for path in values):
            message = f"values are given by the paths of parameters, and not as {short_repr(values)}"
            raise Problem(error("E431", message, help='by path: `{"gearbox.kp": 0.02}`'))
        for path, value in values.items():
            if path not in self._units:
                self._units[path] = self._deck_run.unit(path)
            unit = self._units[path]
            if unit is None:  # then this reports the mistake in the path
                self._deck_run.vary({path: (value if isinstance(value, str) and value.isidentifier() else 0.0, "1")})
            elif unit == "":
                raise _no_number(path, value)
            in_si[path] = values_in_si(value, path, unit or "1")
        return in_si

    def _program(self, table: Mapping[str, np.ndarray], repeated: bool) -> SimulationProgram:
        """The program whose inputs are the paths of a table of values, SI, one a case; on the first call it is compiled
        with those of the first case. repeated: whether cases have noise of their own"""
        key = tuple(table), repeated
        if key not in self._programs:
            varied = self._deck_run.vary(self._first_values(table), repeat=2 if repeated else 1)
            prepared = engine.prepare(varied.experiment)
            self._programs[key] = SimulationProgram(varied, prepared, DatasetMaker(self._deck_run.deck.file, prepared))
        return self._programs[key]

    def _first_values(self, table: Mapping[str, np.ndarray]) -> dict[str, tuple[float, str]]:
        """The first case's value of each path, SI, with its unit."""
        return {path: (float(column[0]), self._units[path] or "1") for path, column in table.items()}

    def _signals(self, histories: bool | str | Sequence[str], cases: int) -> tuple[str, ...]:
        """The names of the kept signals. Raises Problem E432 for signals that are not recorded, or do not fit in
        memory."""
        if histories is False:
            return ()
        known = [recorded.name for recorded in self.experiment.structure.record]
        names = tuple(known) if histories is True else texts(histories, "histories", "E432", 'True`, or `["q"]')
        for name in names:
            if name not in known:
                helps = [
                    *did_you_mean(name, known),
                    known_words("the run records", known),
                    "the deck's `record` says what",
                ]
                raise Problem(error("E432", f"`{self._deck_run.name}` records no `{name}`", help=helps))
        needed = self.experiment.structure.history_bytes * cases
        if names and needed > memory():
            message = f"histories of {cases:,} cases take {size_text(needed)} of memory"
            raise Problem(error("E432", message, help="run fewer at once, or `batch.run` the sweep into an archive"))
        return names


def _commanded(commands: Any, paths: Iterable[str]) -> dict[str, str]:
    """The kinds of commands by joint, "" for that of the deck. paths: of values. Raises Problem E435."""
    joints = texts(list(commands) if isinstance(commands, Mapping) else commands, "commands", "E435", '["shoulder"]')
    kinds = [""] * len(joints)
    if isinstance(commands, Mapping):
        kinds = list(texts(list(commands.values()), "commands", "E435", '{"shoulder": "torque"}'))
    for place, joint in enumerate(joints):
        if joint in joints[:place]:
            raise Problem(error("E435", f"`commands` has joint `{joint}` twice", help="name each joint once"))
        path = next((path for path in paths if f"{path}.".startswith(f"{joint}.servo.command.")), None)
        if path is not None:
            message = f"`{path}` is given, and joint `{joint}` is commanded from outside"
            helps = [f"leave `{path}` out, and tell `step` its command", f"or leave `{joint}` out of `commands`"]
            raise Problem(error("E435", message, help=helps))
    return dict(zip(joints, kinds, strict=True))


def _cases(template: Cases, table: Mapping[str, np.ndarray], count: int, repeat: int) -> Cases:
    """The cases of a table, as a plan has them."""
    coordinates = [replace(coordinate, values=table[coordinate.path]) for coordinate in template.coordinates]
    repeats = np.tile(np.arange(repeat), count) if repeat > 1 else None
    return replace(template, count=count * repeat, coordinates=tuple(coordinates), repeats=repeats)


def _no_number(path: str, value: Any) -> Problem:
    """The error for a path that is a word and no number (E434)."""
    helps = f'`batch.Simulation(..., set={{"{path}": {str(value)!r}}})`'
    return Problem(
        error("E434", f"`{path}` is a word, not a number", help=f"what decides the program is set once: {helps}")
    )
