"""Line plots in a terminal: eight dots a character (Unicode braille), axes with numbers and units."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from met.messages.visible import line

DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])
"""Bit of each dot of a character, by row and column (Unicode, "Braille Patterns")."""

LARGEST = 1e300
"""The largest number that has a place on an axis: sums and ranges of larger ones overflow."""

SMALLEST = 1e-290
"""Smallest nonzero range: a tenth of a smaller one may be 0."""

COLOURS = (33, 208, 36, 170, 220, 74, 166)
"""Terminal colours of the lines: blue, orange, green and so on, which colour-blind eyes can distinguish too."""


def draw(
    time: np.ndarray,
    lines: Sequence[np.ndarray],
    labels: Sequence[str],
    *,
    title: str,
    width: int,
    height: int = 8,
    colour: bool = False,
    time_unit: str = "s",
) -> list[str]:
    """A plot as lines of text, `width` characters wide; each line is labelled where it ends.

    The scale is that of the finite values; a line that breaks off (not-a-number) simply ends.
    """
    title, labels = line(title), [line(label) for label in labels]
    lines = [np.where(np.abs(values) <= LARGEST, values, np.nan) for values in lines]
    right = max((len(label) for label in labels), default=0)
    finite = np.concatenate([values[np.isfinite(values)] for values in lines]) if lines else np.empty(0)
    if len(finite) == 0 or len(time) == 0:
        return [title, "  (no finite values)"]
    low, high = _range(float(finite.min()), float(finite.max()))
    ticks = nice_ticks(low, high, max(2, height // 2))
    numbers = tick_texts(ticks)
    left = max(7, *(len(number) for number in numbers))
    across = max(10, width - left - 2 - (right + 1 if right else 0))

    cells = np.zeros((height, across), dtype=int)
    owner = np.zeros((height, across), dtype=int)
    ends: list[tuple[float, int]] = []
    for index, values in enumerate(lines):
        span = _spans(time, values, 2 * across)
        for column, bottom, top in span:
            first = _dot(top, low, high, 4 * height)
            last = _dot(bottom, low, high, 4 * height)
            for dot in range(first, last + 1):
                cells[dot // 4, column // 2] |= DOTS[dot % 4, column % 2]
                owner[dot // 4, column // 2] = index
        if span:
            ends.append((_dot(float(values[np.isfinite(values)][-1]), low, high, 4 * height) / 4, index))

    at = {
        min(height - 1, _dot(tick, low, high, 4 * height) // 4): number
        for tick, number in zip(ticks, numbers, strict=True)
    }
    beside = _spread(ends, height)
    out = [title]
    for row in range(height):
        mark = "┤" if row in at else "│"
        body = _painted(cells[row], owner[row], colour)
        label = ""
        if row in beside:
            index = beside[row]
            label = " " + (_paint(labels[index], index) if colour else labels[index])
        out.append(f"{at.get(row, ''):>{left}} {mark}{body}{label}".rstrip())
    return out + _time_axis(float(time[0]), float(time[-1]), left, across, time_unit)


def _range(low: float, high: float) -> tuple[float, float]:
    """The range with room around the values; a constant gets some too."""
    spread = high - low
    if spread <= max(1e-12 * max(abs(low), abs(high)), SMALLEST):
        spread = abs(high) * 0.2 if abs(high) > SMALLEST else 1.0
        return low - spread / 2, high + spread / 2
    return low - 0.03 * spread, high + 0.03 * spread


def nice_ticks(low: float, high: float, count: int) -> list[float]:
    """About `count` round numbers between two numbers: steps of 1, 2 or 5 times a power of ten."""
    rough = (high - low) / max(1, count)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next((power * factor for factor in (1, 2, 5) if power * factor >= rough * 0.999), power * 10)
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


def tick_texts(ticks: Sequence[float]) -> list[str]:
    """The ticks with as many digits as their distance needs."""
    if not ticks:
        return []
    step = abs(ticks[1] - ticks[0]) if len(ticks) > 1 else abs(ticks[0]) or 1.0
    largest = max(abs(tick) for tick in ticks) or step
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    if largest >= 1e5 or digits > 4:
        meaningful = max(0, math.floor(math.log10(largest) + 1e-9) - math.floor(math.log10(step) + 1e-9))
        return ["0" if abs(tick) < step / 2 else f"{tick:.{meaningful}e}" for tick in ticks]
    return [f"{tick + 0.0:.{digits}f}" if abs(tick) >= step / 2 else "0" for tick in ticks]


def _dot(value: float, low: float, high: float, count: int) -> int:
    """The row of a value's dot, from the top."""
    return min(count - 1, max(0, int((high - value) / (high - low) * count)))


def _spans(time: np.ndarray, line: np.ndarray, columns: int) -> list[tuple[int, float, float]]:
    """Column of dots, lowest and highest value there, for every column that the line passes."""
    good = np.isfinite(line)
    if not good.any():
        return []
    reach = float(time[-1] - time[0]) or 1.0
    edges = time[0] + reach * np.arange(columns + 1) / columns
    t, y = time[good], line[good]
    inside = np.interp(edges, t, y)
    out = []
    starts = np.searchsorted(t, edges, side="left")
    starts[-1] = len(t)
    for column in range(columns):
        if edges[column] > t[-1] or edges[column + 1] < t[0]:
            continue
        values = y[starts[column] : starts[column + 1]]
        ends = inside[column : column + 2] if edges[column + 1] <= t[-1] else inside[column : column + 1]
        both = np.concatenate([values, ends])
        out.append((column, float(both.min()), float(both.max())))
    return out


def _spread(ends: list[tuple[float, int]], height: int) -> dict[int, int]:
    """A row of its own for every line's label, near its end."""
    taken: dict[int, int] = {}
    for place, index in sorted(ends):
        free = [row for row in range(height) if row not in taken]
        if free:
            taken[min(free, key=lambda row: abs(row + 0.5 - place))] = index
    return taken


def _painted(cells: np.ndarray, owner: np.ndarray, colour: bool) -> str:
    if not colour:
        return "".join(chr(0x2800 + bits) if bits else " " for bits in cells.tolist())
    out, last = "", -1
    for bits, index in zip(cells.tolist(), owner.tolist(), strict=True):
        wanted = index if bits else -1
        if wanted != last:
            out += "\x1b[0m" if wanted < 0 else f"\x1b[38;5;{COLOURS[wanted % len(COLOURS)]}m"
            last = wanted
        out += chr(0x2800 + bits) if bits else " "
    return out + ("\x1b[0m" if last >= 0 else "")


def _paint(text: str, index: int) -> str:
    return f"\x1b[38;5;{COLOURS[index % len(COLOURS)]}m{text}\x1b[0m"


def _time_axis(first: float, last: float, left: int, across: int, unit: str) -> list[str]:
    """The axis below: marks at round times, their numbers, and the unit after the last."""
    if last <= first:
        last = first + 1.0
    ticks = nice_ticks(first, last, max(2, across // 14))
    texts = tick_texts(ticks)
    axis, numbers = ["─"] * across, [" "] * (across + 12)
    for index, (tick, text) in enumerate(zip(ticks, texts, strict=True)):
        column = min(across - 1, int((tick - first) / (last - first) * across))
        axis[column] = "┬"
        text = f"{text} {unit}" if index == len(ticks) - 1 else text
        start = max(0, column - len(texts[index]) // 2)
        numbers[start : start + len(text)] = text
    return [" " * (left + 1) + "└" + "".join(axis), (" " * (left + 2) + "".join(numbers)).rstrip()]
