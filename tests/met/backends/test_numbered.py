"""The name of an object in the cache: what decides the code, and not how anything in it is called."""

from __future__ import annotations

import hashlib
import re
from dataclasses import replace

import pytest

from met import backends
from met.backends.llvm.emit import emit, numbered
from met.trace import floor, gather, sqrt, where
from met.trace.noise import Stream, normal
from met.trace.program import (
    CallPhase,
    Every,
    Phase,
    Program,
    Recording,
    RecordPhase,
    RunPhase,
    Tape,
    Unless0,
    WhileAny,
)
from met.trace.recorder import record

EMITTED = {
    "llvm": (1, "a1e7cd38e71183e9b15efb2e0a95dafe57424dc2492546e32ec024a3afda4b88"),
    "c": (1, "98a25e53dab88ed92b8ec364c056cd22708a8ea93707bcdf444a73c8c25df4e3"),
    "wasm": (1, "0c42442889f1cc4047344906f5de0f8a3843083a55fd23e1037c1528845cac17"),
    "reference": (1, "d6a25374b0e6cb6afa4bf48bd9298cfb16205ee16aa62398f26b455bad70059c"),
}
"""Version of each back end, and SHA-256 of what it makes of `everything`, names aside. Where a lowering is changed so
that the bits of a recording may change, raise its version; where it is not, put the new digest here."""


def everything(*, cell: str = "x", half: float = 0.5) -> Recording:
    """A program with every operation and every kind of control."""

    def start(tape: Tape) -> None:
        tape.write(cell, tape.input("first"))

    def body(tape: Tape) -> None:
        x = tape.read(cell)
        drawn = normal(Stream(tape.input("seed"), tape.input("repeat"), "x"), tape.tick)
        y = where(x > tape.time, sqrt(x * x + half), floor(x) / 3.0) - drawn
        tape.write(cell, gather((0.0, 1.0, 0.25), y) + y * 0.125)
        tape.write_mask("on", abs(y) < 1.0)

    def again(tape: Tape) -> None:
        tape.write(cell, tape.read(cell) * half)
        tape.write("on", 0.0)

    return record(
        Program(
            base_hz=8.0,
            start=(RunPhase(Phase("start", start)),),
            tick=(
                Unless0(
                    (Every(2, (CallPhase(Phase("body", body)),)), WhileAny("on", 3, (RunPhase(Phase("again", again)),)))
                ),
                RecordPhase(Phase("row", lambda tape: tape.record(0, tape.read(cell))), 2),
            ),
            end=(RunPhase(Phase("end", lambda tape: tape.output("x", tape.read(cell)))),),
            inputs=("first", "seed", "repeat"),
            columns=1,
            outputs=("x",),
        )
    )


def test_names_of_cells_do_not_count() -> None:
    here, renamed = emit(everything(), 8), emit(everything(cell="elsewhere"), 8)
    assert here != renamed
    assert numbered(here) == numbered(renamed)


def test_names_of_temporaries_do_not_count() -> None:
    text = emit(everything(), 8)
    renamed = text.replace("block.end", "case.end").replace("%tick.last", "%last.tick")
    assert renamed != text
    assert numbered(renamed) == numbered(text)


def test_names_in_the_code_of_sections_are_numbers() -> None:
    code = [part for part in emit(everything(), 8).split("\ndefine ") if part.startswith("private void @section.")]
    names = {name for part in code for name in re.findall(r"[%@][\w.]+", part) if not name.startswith("@llvm.")}
    numbers = {name for name in names if re.fullmatch(r"%v\d+|@(section|table)[.\d]+", name)}
    assert len(numbers) > 100
    assert names - numbers == {"%state", "%inputs", "%scratch", "%row", "%outputs", "%tick", "%time"}


def test_sections_names_do_not_count() -> None:
    recording = everything()
    sections = tuple(replace(section, name=f"other {n}") for n, section in enumerate(recording.sections))
    assert numbered(emit(replace(recording, sections=sections), 8)) == numbered(emit(recording, 8))


def test_a_constant_counts() -> None:
    assert numbered(emit(everything(), 8)) != numbered(emit(everything(half=0.25), 8))


def test_which_function_is_called_counts() -> None:
    text = emit(everything(), 8)
    calls = [line.split("(")[0] for line in text.splitlines() if line.startswith("  call void @")]
    one, other = sorted({call for call in calls if "spread" not in call and "memset" not in call})[:2]
    swapped = text.replace(one, "  call void @swap").replace(other, one).replace("  call void @swap", other)
    assert numbered(swapped) != numbered(text)


@pytest.mark.parametrize("name", list(backends.HOMES))
def test_what_a_version_of_a_lowering_makes_is_what_it_made(name: str) -> None:
    version, digest = EMITTED[name]
    recording = everything()
    text = numbered(emit(recording, 8)) if name == "llvm" else backends.find(name).emit(recording)
    assert backends.find(name).version == version
    assert hashlib.sha256(text.encode()).hexdigest() == digest
