"""A recorded program as text: control, then each section, operation by operation; `%n` is the result of operation n."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from met.trace.nodes import show
from met.trace.program import Branch, Every, RecordedControl, Recording, RecordSection, WhileAny


def lines(recording: Recording) -> Iterator[str]:
    """The lines of the listing."""
    program = recording.program
    for name, words in (("inputs", program.inputs), ("outputs", program.outputs), ("cells", recording.cells)):
        yield f"{name}: {', '.join(words) or 'none'}"
    names = [section.name for section in recording.sections]
    for name, steps in (("start", recording.start), ("tick", recording.tick), ("end", recording.end)):
        yield f"{name}:"
        yield from _control(steps, names, "    ")
    for number, section in enumerate(recording.sections):
        yield ""
        yield f"section {number}, {section.name}: {len(section.order)} operations"
        yield from (f"    %{i} = {show(section.nodes, i)}" for i in section.order)
        for cell, reference in section.stores:
            yield f"    cell {cell} = {_operand(reference)}"
        for column, reference in section.records:
            yield f"    column {column} = {_operand(reference)}"
        for output, reference in section.outputs:
            yield f"    output {program.outputs[output]} = {_operand(reference)}"


def _control(steps: Sequence[RecordedControl], names: Sequence[str], indent: str) -> Iterator[str]:
    """The lines of control, one a step with the section's name, the bodies of blocks indented."""
    for step in steps:
        if isinstance(step, Branch):
            match step.condition:
                case Every(divisor):
                    yield f"{indent}at ticks that {divisor} divides:"
                case WhileAny(cell, at_most):
                    limit = "once" if at_most == 1 else f"{at_most} times"
                    yield f"{indent}while {cell} is not 0 in any case of the block, at most {limit}:"
                case _:
                    yield f"{indent}at all ticks but tick 0:"
            yield from _control(step.body, names, indent + "    ")
        elif isinstance(step, RecordSection):
            yield f"{indent}section {step.section}, {names[step.section]}, at ticks that {step.divisor} divides"
        else:
            yield f"{indent}section {step.section}, {names[step.section]}"


def _operand(reference: int) -> str:
    return f"{'-' if reference & 1 else ''}%{reference >> 1}"
