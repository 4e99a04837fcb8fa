"""rtamt's answers to requirements over time, of 1,000 random traces: what `monitor_rtamt.csv.gz` was made with.

rtamt (Nickovic and Yamaguchi, RTAMT: Online Robustness Monitors from STL, ATVA 2020; BSD licence) computes the
robustness of formulas of signal temporal logic. It cannot stand in requirements-all.lock: it wants
antlr4-python3-runtime 4.7, which is no wheel and does not run on Python 3.13, and environments here are made of wheels
alone. So its answers are kept, and this file makes them anew in an environment that has it, Python 3.11 or 3.12:

    pip install rtamt==0.4.10
    python -W ignore -m tests.oracles.monitor_rtamt

Each trace is three signals, x, y and z, of SAMPLES samples at RATE: an offset and a sine; the file has their numbers.
"""

from __future__ import annotations

import csv
import gzip
import io
import math
import random
from pathlib import Path

ANSWERS = Path(__file__).with_name("monitor_rtamt.csv.gz")
TRACES, SAMPLES, RATE = 1000, 101, 100
SIGNALS = ("x", "y", "z")
NUMBERS = ("amplitude", "frequency", "phase", "offset")

CONDITION = "((x < 0.6) and (y > -0.7)) or (not (z <= 0.2 * x))"
RARE = "(x < -0.6) and (y > 0.5)"
"""Conditions as rtamt writes them: one that mostly holds, one that seldom does."""

FORMULAS = {
    "always": f"always[0ms:1s]({CONDITION})",
    "always_late": f"always[250ms:1s]({CONDITION})",
    "always_within": f"always[70ms:350ms]({CONDITION})",
    "eventually": f"eventually[0ms:1s]({RARE})",
    "eventually_within": f"eventually[300ms:360ms]({RARE})",
    "never": f"always[0ms:1s](not ({RARE}))",
    "never_within": f"always[500ms:600ms](not ({RARE}))",
    "nearer": "always[0ms:400ms](abs(x - y) < 2.5 + z)",
    "stretch": f"eventually[0ms:700ms](always[0ms:300ms]({CONDITION}))",
    "stretch_late": f"eventually[250ms:950ms](always[0ms:50ms]({RARE}))",
}
"""Formulas whose robustness at the first sample is kept, by the metric that is compared with it."""

SHARES = ("share_of_time", "share_late")
"""Shares of samples, of all and of those from 0.25 s on, at which the condition's robustness is 0 or more."""


def rows_of_traces() -> list[dict[str, float]]:
    """The numbers of the traces: `x.amplitude` and so on, with few enough digits to be written exactly."""
    source = random.Random(21)
    ranges = {"amplitude": (0.1, 1.5), "frequency": (0.2, 4.0), "phase": (-3.1, 3.1), "offset": (-0.7, 0.7)}
    return [
        {f"{signal}.{name}": round(source.uniform(*ranges[name]), 6) for signal in SIGNALS for name in NUMBERS}
        for _ in range(TRACES)
    ]


def trace_of(row: dict[str, float]) -> dict[str, list[float]]:
    """The signals of a trace."""
    out = {"time": [k / RATE for k in range(SAMPLES)]}
    for signal in SIGNALS:
        amplitude, frequency, phase, offset = (row[f"{signal}.{name}"] for name in NUMBERS)
        out[signal] = [offset + amplitude * math.sin(2.0 * math.pi * frequency * t + phase) for t in out["time"]]
    return out


def read() -> tuple[list[dict[str, float]], list[dict[str, float]]]:
    """The traces' numbers, and rtamt's answers of each."""
    with gzip.open(ANSWERS, "rt", encoding="utf-8") as file:
        rows = [{name: float(text) for name, text in row.items()} for row in csv.DictReader(file)]
    answers = (*FORMULAS, *SHARES)
    return [{k: v for k, v in row.items() if k not in answers} for row in rows], [
        {k: row[k] for k in answers} for row in rows
    ]


def main() -> None:
    """Ask rtamt, and write its answers."""
    import rtamt

    def robustness(formula: str, trace: dict[str, list[float]]) -> list[float]:
        monitor = rtamt.StlDiscreteTimeOfflineSpecification()
        for name in SIGNALS:
            monitor.declare_var(name, "float")
        monitor.set_sampling_period(1000 // RATE, "ms", 0.1)
        monitor.spec = formula
        monitor.parse()
        return [value for _, value in monitor.evaluate(trace)]

    found = []
    for row in rows_of_traces():
        trace = trace_of(row)
        answers = {name: robustness(formula, trace)[0] for name, formula in FORMULAS.items()}
        margins = robustness(CONDITION, trace)
        for name, first in zip(SHARES, (0, RATE // 4), strict=True):
            answers[name] = sum(margin >= 0.0 for margin in margins[first:]) / (SAMPLES - first)
        found.append({**row, **answers})
    text = io.StringIO()
    writer = csv.DictWriter(text, list(found[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(found)
    with ANSWERS.open("wb") as raw, gzip.GzipFile(fileobj=raw, mode="wb", mtime=0, filename="") as file:
        file.write(text.getvalue().encode())


if __name__ == "__main__":
    main()
