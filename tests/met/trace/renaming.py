"""A program with other names for its cells and inputs: what it computes is the same."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

from met.trace.program import CallPhase, Control, Phase, Program, RecordPhase, RunPhase, Tape, WhileAny

Name = Callable[[str], str]


class Renaming:
    """A tape under which cells and inputs have other names."""

    def __init__(self, tape: Tape, cell: Name, given: Name) -> None:
        self._tape, self._cell, self._given = tape, cell, given

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tape, name)

    def read(self, name: str) -> Any:
        return self._tape.read(self._cell(name))

    def write(self, name: str, value: Any) -> None:
        self._tape.write(self._cell(name), value)

    def read_mask(self, name: str) -> Any:
        return self._tape.read_mask(self._cell(name))

    def write_mask(self, name: str, value: Any) -> None:
        self._tape.write_mask(self._cell(name), value)

    def input(self, name: str) -> Any:
        return self._tape.input(self._given(name))


def renamed(program: Program, cell: Name, given: Name = lambda name: name) -> Program:
    """The program with these names for its cells and its inputs."""
    phases: dict[int, Phase] = {}

    def phase_of(phase: Phase) -> Phase:
        made = Phase(phase.name, lambda tape: phase.body(Renaming(tape, cell, given)))  # type: ignore[arg-type]
        return phases.setdefault(id(phase), made)  # one that is called twice is one still

    def body_of(body: tuple[Control, ...]) -> tuple[Control, ...]:
        out: list[Control] = []
        for node in body:
            if isinstance(node, RunPhase | CallPhase | RecordPhase):
                out.append(replace(node, phase=phase_of(node.phase)))
            elif isinstance(node, WhileAny):
                out.append(replace(node, cell=cell(node.cell), body=body_of(node.body)))
            else:
                out.append(replace(node, body=body_of(node.body)))
        return tuple(out)

    return replace(
        program,
        start=body_of(program.start),
        tick=body_of(program.tick),
        end=body_of(program.end),
        inputs=tuple(map(given, program.inputs)),
        counters=tuple(map(cell, program.counters)),
    )
