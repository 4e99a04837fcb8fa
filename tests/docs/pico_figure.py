"""Draws docs/figures/pico.svg, the wiring of a bench on a Raspberry Pi Pico: `python -m tests.docs.pico_figure`."""

from __future__ import annotations

from pathlib import Path
from xml.sax.saxutils import escape

PICTURE = Path(__file__).parents[2] / "docs" / "figures" / "pico.svg"

# (pin of the board, its name, what is wired to it), from the top; rows with one text are one box
LEFT = [
    (1, "GP0 TX", "USB adapter, 3.3 V, isolated"),
    (2, "GP1 RX", "USB adapter, 3.3 V, isolated"),
    (4, "GP2 A", "encoder, by a line receiver of 3.3 V"),
    (5, "GP3 B", "encoder, by a line receiver of 3.3 V"),
    (6, "GP4 stop", "emergency stop: its second contact"),
    (7, "GP5 ready", "both amplifiers' ready contacts, in series"),
    (9, "GP6 enabled", "enable as it arrives at the amplifiers"),
    (10, "GP7 key", "key switch"),
    (11, "GP8 load enable", "load's amplifier: enable, by a contact of K1"),
    (12, "GP9 drive enable", "drive's amplifier: enable, by a contact of K1"),
    (14, "GP10 brake", "brake's relay: closed releases it"),
    (15, "GP11 pulse", "monostable of 5 ms: holds relay K1"),
    (16, "GP12 S0", "multiplexer 74HC4052: select"),
    (17, "GP13 S1", "multiplexer 74HC4052: select"),
]
RIGHT = [
    (36, "3V3", "multiplexer, receivers: supply"),
    (35, "ADC VREF", "filter of 200 ohm, 10 uF from 3V3"),
    (33, "AGND", "analogue ground, to GND at this pin alone"),
    (34, "GP28 ADC2", "multiplexer: load's current, winding, bus, half VREF"),
    (32, "GP27 ADC1", "drive's current sensor, 0 to 3.3 V"),
    (31, "GP26 ADC0", "tachometer by its filter, 0 to 3.3 V"),
    (25, "GP19 load -", "difference amplifier: load's current command"),
    (24, "GP18 load +", "difference amplifier: load's current command"),
    (22, "GP17 drive -", "difference amplifier: drive's voltage command"),
    (21, "GP16 drive +", "difference amplifier: drive's voltage command"),
    (39, "VSYS", "5 V, by a diode"),
    (38, "GND", "ground of inputs and outputs"),
]
ROW, TOP, BOARD, WIDE, WIRE = 30, 40, (390, 230), 300, 70


def svg() -> str:
    """The picture's text."""
    x, width = BOARD
    height = TOP + ROW * max(len(LEFT), len(RIGHT)) + 20
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * x + width} {height}" font-family="sans-serif" '
        'font-size="12">',
        "<title>Wiring of a bench on a Raspberry Pi Pico</title>",
        f'<rect width="{2 * x + width}" height="{height}" fill="#fff"/>',
        f'<rect x="{x}" y="{TOP - 20}" width="{width}" height="{height - TOP + 8}" rx="8" fill="#e8f2ea" '
        'stroke="#2b6a3c"/>',
        f'<text x="{x + width / 2}" y="{TOP - 4}" text-anchor="middle" font-weight="bold">Raspberry Pi Pico</text>',
    ]
    for rows, left in ((LEFT, True), (RIGHT, False)):
        for k, (pin, name, _) in enumerate(rows):
            y = TOP + ROW * k + 20
            near, far = (x, x - WIRE) if left else (x + width, x + width + WIRE)
            inside, anchor = (x + 8, "start") if left else (x + width - 8, "end")
            out.append(f'<line x1="{near}" y1="{y}" x2="{far}" y2="{y}" stroke="#333"/>')
            out.append(f'<text x="{inside}" y="{y + 4}" text-anchor="{anchor}">{escape(name)}</text>')
            at = near - 6 if left else near + 6
            out.append(
                f'<text x="{at}" y="{y - 3}" font-size="10" text-anchor="{"end" if left else "start"}">{pin}</text>'
            )
        first = 0
        for k in range(len(rows)):
            if k + 1 < len(rows) and rows[k + 1][2] == rows[k][2]:
                continue
            y, tall = TOP + ROW * first + 8, ROW * (k - first) + 24
            box = x - WIRE - WIDE if left else x + width + WIRE
            out.append(f'<rect x="{box}" y="{y}" width="{WIDE}" height="{tall}" rx="4" fill="#f4f4f4" stroke="#888"/>')
            text = escape(rows[k][2])
            out.append(f'<text x="{box + WIDE / 2}" y="{y + tall / 2 + 4}" text-anchor="middle">{text}</text>')
            first = k + 1
    return "\n".join([*out, "</svg>", ""])


if __name__ == "__main__":
    PICTURE.write_text(svg(), encoding="utf-8")
