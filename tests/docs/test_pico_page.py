"""docs/pico.md and its picture wire the pins that the port drives and reads."""

from __future__ import annotations

import re

from hw.boards.build import FIRMWARE
from tests.docs.pico_figure import LEFT, PICTURE, RIGHT, svg

PAGE = PICTURE.parents[1] / "pico.md"

# The board's pins of GP0 to GP28 (Raspberry Pi Pico data sheet, figure 2).
BOARD = {
    **dict(zip(range(16), (1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20), strict=True)),
    **dict(zip((16, 17, 18, 19, 20, 21, 22, 26, 27, 28), (21, 22, 24, 25, 26, 27, 29, 31, 32, 34), strict=True)),
}
NAMES = {
    "TX": 0, "RX": 1, "ENCODER_A": 2, "ENCODER_B": 3, "STOP": 4, "READY": 5, "ENABLED": 6, "KEY": 7, "LOAD_ENABLE": 8,
    "DRIVE_ENABLE": 9, "BRAKE_RELEASE": 10, "PULSE": 11, "SELECT_0": 12, "SELECT_1": 13, "DRIVE_UP": 16,
    "DRIVE_DOWN": 17, "LOAD_UP": 18, "LOAD_DOWN": 19, "LED": 25, "RATE": 26, "DRIVE_CURRENT": 27, "MULTIPLEXER": 28,
}  # fmt: skip


def test_the_port_has_the_pins_that_the_page_says() -> None:
    text = "".join((FIRMWARE / "pico" / name).read_text(encoding="utf-8") for name in ("port.c", "main.c"))
    found = {name: int(pin) for name, pin in re.findall(r"#define PIN_(\w+) (\d+)u", text)}
    assert found == NAMES
    rows = re.findall(r"^\| ([\d, ]+) \| ((?:GP\d+(?:, )?)+) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
    told = {
        int(gp): int(pin)
        for pins, gps in rows
        for pin, gp in zip(pins.split(", "), re.findall(r"GP(\d+)", gps), strict=True)
    }
    assert told == {gp: BOARD[gp] for gp in NAMES.values() if gp != 25}


def test_the_picture_is_what_its_script_draws_and_has_those_pins() -> None:
    assert PICTURE.read_text(encoding="utf-8") == svg()
    drawn = {int(gp[1]): pin for pin, name, _ in (*LEFT, *RIGHT) if (gp := re.match(r"GP(\d+)", name))}
    assert drawn == {gp: BOARD[gp] for gp in NAMES.values() if gp != 25}
