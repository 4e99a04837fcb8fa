"""In lock-step a Pico in its emulator has the bits of the build for this machine, which are the simulated bed's."""

from __future__ import annotations

from typing import Any

import pytest

from met.plant import plant_c
from tests.hw.firmware import wire
from tests.hw.firmware.line import PLANT, STEPPED, Line, behind_a_terminal
from tests.hw.firmware.pico.emulated import EmulatedLine, Emulator, pico_simulation, skip_without_tools
from tests.hw.firmware.test_arm import moved
from tests.substitution.hybrid import compiled, deck

pytestmark = [pytest.mark.firmware, pytest.mark.node]


@pytest.fixture(scope="module", autouse=True)
def tools() -> None:
    skip_without_tools()


class PicoLine(Line):
    """A line to an emulated Pico, asked by hand."""

    def __init__(self, emulator: Emulator) -> None:
        super().__init__(-1)
        self._line = EmulatedLine(emulator)

    def ask(self, kind: int, body: bytes = b"", *, wait: float = 5.0) -> Any:
        self.number = (self.number + 1) & 0xFFFF
        self._line.send(wire.frame(kind, self.number, body))
        [payload] = wire.payloads(self._line.receive(self._line.now() + wait))
        found = wire.told(payload)
        assert found.number == self.number
        return found


def full_plant() -> str:
    """A deck's bed with all its faults."""
    return plant_c(compiled(deck(bed="emulated(faults = typical)"), "on_bench"), "shoulder")


@pytest.mark.parametrize(("plant", "steps"), [(PLANT, 400), (full_plant, 100)], ids=["plain", "all faults"])
def test_in_lock_step_it_has_the_bits_of_the_build_for_this_machine(plant: Any, steps: int) -> None:
    text = plant if isinstance(plant, str) else plant()
    with behind_a_terminal(STEPPED, plant=text) as (line, _):
        here = moved(line, steps)
    with Emulator(pico_simulation(STEPPED, text)) as emulator:
        emulator.sleep(0.15)
        there = moved(PicoLine(emulator), steps)
    assert [each.state for each in there] == [wire.ARMED] * (steps + 1)
    assert there == here
    assert max(abs(each.rate) for each in there) > 50


def test_hello_is_the_same_but_for_session_and_firmware() -> None:
    with behind_a_terminal(STEPPED) as (line, _):
        here = line.greet()
    with Emulator(pico_simulation(STEPPED, PLANT)) as emulator:
        emulator.sleep(0.15)
        there = PicoLine(emulator).greet()
    assert there.firmware != here.firmware  # another board's sources
    assert {**vars(there), "session": 0, "firmware": b""} == {**vars(here), "session": 0, "firmware": b""}
