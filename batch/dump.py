"""The stages of `met dump` behind the plan: the recorded program, its vector code, and the machine's."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from ic.printing.dump import Asked

if TYPE_CHECKING:
    from met.plan import Experiment
    from met.trace.llvm import Machine
    from met.trace.recording import Step


def program(asked: Asked) -> Iterator[str]:
    """What is computed when: control, then each straight piece, operation by operation; `%n` is what number n gives."""
    from met.program.build import build
    from met.trace.graph import show
    from met.trace.recorder import record

    for experiment in _experiments(asked):
        recording = record(build(experiment))
        made = recording.program
        yield f"program of {experiment.name}: base rate {made.base_hz:g} Hz"
        for name, words in (("inputs", made.inputs), ("outputs", made.outputs), ("cells", recording.cells)):
            yield f"{name}: {', '.join(words) or 'none'}"
        for name, steps in (("start", recording.start), ("tick", recording.tick), ("end", recording.end)):
            yield f"{name}:"
            yield from _steps(steps, [section.name for section in recording.sections], "    ")
        for number, section in enumerate(recording.sections):
            yield ""
            yield f"section {number}, {section.name}: {len(section.order)} operations"
            yield from (f"    %{i} = {show(section.nodes, i)}" for i in section.order)
            for cell, reference in section.stores:
                yield f"    cell {cell} = {_operand(reference)}"
            for column, reference in section.records:
                yield f"    column {column} = {_operand(reference)}"
            for output, reference in section.outputs:
                yield f"    output {made.outputs[output]} = {_operand(reference)}"


def kernel(asked: Asked) -> Iterator[str]:
    """The LLVM code of the program as MET writes it for this machine."""
    for _, text in _emitted(asked):
        yield text


def assembly(asked: Asked) -> Iterator[str]:
    """The machine code of the program, as this processor's assembler would read it."""
    from met.trace import llvm

    for machine, text in _emitted(asked):
        yield llvm.listing(text, machine)


def _emitted(asked: Asked) -> Iterator[tuple[Machine, str]]:
    from met import kernel as engine
    from met.program.build import build
    from met.trace import llvm
    from met.trace.recorder import record

    machine = llvm.machine()
    for experiment in _experiments(asked):
        _, text = engine.written(record(build(experiment)), machine)
        yield machine, text


def _experiments(asked: Asked) -> Sequence[Experiment]:
    return asked.plan().experiments


def _steps(steps: Sequence[Step], names: Sequence[str], indent: str) -> Iterator[str]:
    """Control, one line a step with the section's name, the bodies of blocks indented."""
    from met.trace.program import Every, WhileAny
    from met.trace.recording import Block, Recorded

    for step in steps:
        if isinstance(step, Block):
            match step.condition:
                case Every(divisor):
                    yield f"{indent}at ticks that {divisor} divides:"
                case WhileAny(cell, at_most):
                    limit = "once" if at_most == 1 else f"{at_most} times"
                    yield f"{indent}while {cell} is not 0 in any case of the block, at most {limit}:"
                case _:
                    yield f"{indent}at all ticks but tick 0:"
            yield from _steps(step.body, names, indent + "    ")
        elif isinstance(step, Recorded):
            yield f"{indent}section {step.section}, {names[step.section]}, at ticks that {step.divisor} divides"
        else:
            yield f"{indent}section {step.section}, {names[step.section]}"


def _operand(reference: int) -> str:
    return f"{'-' if reference & 1 else ''}%{reference >> 1}"
