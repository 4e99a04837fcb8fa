"""Are spoilt logs noticed? Logs of made arms are spoilt in one way each, and fitted.

python -m tests.batch.fitting.spoilt FIRST LAST     logs FIRST to LAST - 1: how each is spoilt, and what is said of it
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import batch
from batch.fitting.question import fit_question
from batch.terminal.fit import as_data, fit_lines
from tests.batch.fitting.truth import deck, write_log

Log = tuple[list[str], np.ndarray]
"""The heads of a log's columns, `time [s]` first, and its rows."""

KINDS = ("unit", "degrees", "sign", "exchanged", "clock", "jump", "missing", "no torque", "another arm")
NOTES = {"missing": "instants are missing", "no torque": "not in the log: "}
"""Kinds that are no mistake of a number, and a word of the note that is due."""


def spoilt(kind: str, log: Log, other: Log, draw: np.random.Generator) -> Log:
    """A log with a mistake. other: the log of an arm with other numbers"""
    heads, rows = log[0], log[1].copy()
    torques = [k for k, head in enumerate(heads) if "torque" in head or ".tau" in head]
    angles = [k for k, head in enumerate(heads) if ".q [" in head]
    if kind == "unit":
        rows[:, draw.choice(torques)] *= 1000.0
    elif kind == "degrees":
        rows[:, draw.choice(angles)] *= np.degrees(1.0)
    elif kind == "sign":
        rows[:, draw.integers(1, len(heads))] *= -1.0
    elif kind == "exchanged":
        first, last = angles[0], angles[-1]
        rows[:, [first, last]] = rows[:, [last, first]]
    elif kind == "clock":
        rows[:, 0] *= 1.02
    elif kind == "jump":
        rows[rows[:, 0] > 4.0, 0] += 0.05
    elif kind == "missing":
        rows = rows[(rows[:, 0] < 3.0) | (rows[:, 0] > 3.4)]
    elif kind == "no torque":
        keep = [k for k in range(len(heads)) if k not in torques]
        heads, rows = [heads[k] for k in keep], rows[:, keep]
    else:
        rows = other[1]
    return heads, rows


def read(path: Path) -> Log:
    """The heads and rows of a log."""
    head, *rows = path.read_text().splitlines()
    return head.split(","), np.array([[float(cell) for cell in row.split(",")] for row in rows])


def main(first: int, last: int) -> None:
    """Print how each log is spoilt, and what the fit says of it."""
    noticed = 0
    for seed in range(first, last):
        draw, kind = np.random.default_rng(1000 + seed), KINDS[seed % len(KINDS)]
        joints = int(draw.integers(2, 6))
        names = [f"links.l{joints - 1}.mass", "s0.f_c"]
        with tempfile.TemporaryDirectory() as folder:
            path, log = Path(folder) / "arm.ic", Path(folder) / "log.csv"
            path.write_text(deck(draw, joints))
            sim = batch.Simulation(path)
            write_log(log, sim, {names[0]: draw.uniform(3.0, 40.0), names[1]: draw.uniform(0.015, 0.03)}, draw)
            good, stranger = read(log), Path(folder) / "stranger.ic"
            stranger.write_text(deck(draw, joints))
            write_log(log, batch.Simulation(stranger), {}, draw)
            heads, rows = spoilt(kind, good, read(log), draw)
            log.write_text("\n".join([",".join(heads), *(",".join(map(repr, map(float, row))) for row in rows), ""]))
            question = fit_question(str(path), [str(log)], names)
            answer = question.answer(lambda _: None)
        data, lines = as_data(question, answer), list(fit_lines(question, answer))
        notes = [line.strip() for line in lines if "note:" in line]
        said = any(NOTES[kind] in each for each in notes) if kind in NOTES else not data["certain"]
        noticed += said
        words = [*data["doubts"], *(notes if kind in NOTES else [])][:2]
        print(f"log {seed}: {kind}: {'said' if said else 'SILENT'}: {' | '.join(words)[:160]}", flush=True)
    print(f"{noticed} of {last - first} spoilt logs are said to be")


if __name__ == "__main__":
    main(*(int(each) for each in sys.argv[1:3]))
