"""`optimisers.hardest` with 2,000 cases against 100,000 random ones, on decks that are shipped, ten seeds each.

python -m tests.met.optimisers.against_random [CASES]     prints a line for each metric: some minutes on two cores
"""

from __future__ import annotations

import re
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import ic
from met import optimisers, run
from met.frozen import frozen
from met.program.build import METRIC
from met.unit_parser import parse_unit

SEARCHED, SEEDS, AT_ONCE = 2000, 10, 4096


@frozen
class Question:
    """A deck, a run of it, what is spread, and the metrics whose worst is looked for: those with a minus are to be
    small."""

    deck: str
    run: str
    metrics: tuple[str, ...]
    spread: str


QUESTIONS = (
    Question(
        "two_link",
        "nominal",
        ("settle", "volts"),
        """links.upper.mass = uniform(30, 50) kg;  links.lower.mass = uniform(10, 40) kg;
        gearbox.kp = uniform(0.01, 0.04) V*s/rad;  gearbox.ki = uniform(0.06, 0.25) V/rad;
        gearbox.kt = uniform(0.058, 0.064) N*m/A;  gearbox.resistance = uniform(1.9, 2.2) ohm;
        gearbox.f_c = uniform(0.015, 0.03) N*m;""",
    ),
    Question(
        "panda",
        "reach",
        ("settle", "past", "-sag", "-effort", "volts"),
        """links.load.mass = uniform(0.1, 3) kg;  links.link4.mass = uniform(3.2, 4) kg;
        links.link5.mass = uniform(1, 1.4) kg;  links.link6.mass = uniform(1.4, 1.9) kg;
        panda_large.kp = uniform(0.03, 0.1) V*s/rad;  panda_large.ki = uniform(1, 3) V/rad;
        panda_small.kp = uniform(0.015, 0.03) V*s/rad;  panda_small.ki = uniform(0.5, 1.5) V/rad;
        environment.gravity.z = uniform(-9.83, -9.78) m/s^2;
        initial.joint1.q = uniform(-2, 2) deg;  initial.joint2.q = uniform(-47, -43) deg;
        initial.joint3.q = uniform(-2, 2) deg;  initial.joint4.q = uniform(-137, -133) deg;
        initial.joint5.q = uniform(-2, 2) deg;  initial.joint6.q = uniform(88, 92) deg;
        initial.joint7.q = uniform(43, 47) deg;""",
    ),
    Question(
        "manutec_r3",
        "manutec_r3_move",
        ("fast", "effort"),
        """links.load.mass = uniform(5, 20) kg;  r3_drive.bandwidth = uniform(60, 140) 1/s;
        initial.joint1.q = uniform(-62, -58) deg;  initial.joint2.q = uniform(18, 22) deg;
        initial.joint3.q = uniform(88, 92) deg;  initial.joint4.q = uniform(-2, 2) deg;
        initial.joint5.q = uniform(-112, -108) deg;  initial.joint6.q = uniform(-2, 2) deg;""",
    ),
    Question(
        "puma_560",
        "puma_reach",
        ("effort", "there"),
        """puma_drive.bandwidth = uniform(30, 70) 1/s;  environment.gravity.z = uniform(-9.83, -9.78) m/s^2;
        initial.waist.q = uniform(-5, 5) deg;  initial.shoulder.q = uniform(-5, 5) deg;
        initial.elbow.q = uniform(-95, -85) deg;  initial.bend.q = uniform(-5, 5) deg;
        initial.turn.q = uniform(-5, 5) deg;""",
    ),
    Question(
        "shuttle_arm",
        "shuttle_arm_driven",
        ("there", "past", "effort", "volts"),
        """links.payload.mass = uniform(0, 2000) kg;  links.hand.mass = uniform(40, 50) kg;
        links.palm.mass = uniform(41, 51) kg;  links.wrist.mass = uniform(7, 10) kg;
        initial.shoulder_yaw.q = uniform(-2, 2) deg;  initial.shoulder_pitch.q = uniform(-2, 2) deg;
        initial.elbow.q = uniform(-2, 2) deg;  initial.wrist_pitch.q = uniform(-2, 2) deg;""",
    ),
    Question(
        "ets_vii",
        "ets_vii_reach",
        ("there", "-far", "effort"),
        """ets_vii_drive.bandwidth = uniform(5, 15) 1/s;
        initial.joint1.q = uniform(-65, -55) deg;  initial.joint2.q = uniform(-65, -55) deg;
        initial.joint3.q = uniform(55, 65) deg;  initial.joint4.q = uniform(-5, 5) deg;
        initial.joint5.q = uniform(-5, 5) deg;  initial.joint6.q = uniform(-5, 5) deg;""",
    ),
)


class Cases:
    """The cases of a question by points of the unit cube, on one kernel."""

    def __init__(self, question: Question, folder: Path) -> None:
        deck = folder / f"{question.deck}_spread.ic"
        deck.write_text(
            f"#include <{question.deck}.ic>\nsweep spread of {question.run} {{\n"
            f"    sample random(2) {{\n        {question.spread}\n    }}\n}}\n"
        )
        experiment = next(each for each in ic.compile(deck).experiments if each.name == "spread")
        self.prepared = run.prepare(experiment)
        spread = re.findall(r"(\S+) = uniform\((\S+), (\S+)\) ([^;]+);", question.spread)
        assert [path for path, *_ in spread] == [coordinate.path for coordinate in experiment.cases.coordinates]
        ends = [[parse_unit(unit).to_si(float(end)) for end in ends] for _, *ends, unit in spread]
        self.low, self.high = np.array(ends).T
        self.dimension = len(ends)
        self.metrics = [name.lstrip("-") for name in question.metrics]
        self.signs = np.array([1.0 if name.startswith("-") else -1.0 for name in question.metrics])

    def values(self, points: np.ndarray) -> np.ndarray:
        """[point, metric], the least the worst; -inf where a case failed, or has none (it never settles)."""
        outputs = self.prepared.program.outputs
        out = np.empty((len(points), len(self.metrics)))
        ticks = self.prepared.experiment.structure.schedule.ticks
        for first in range(0, len(points), AT_ONCE):
            given = self.low + (self.high - self.low) * points[first : first + AT_ONCE]
            _, found = self.prepared.kernel.run(given, ticks, record=False)
            failed = found[:, outputs.index("failure")] != 0.0
            some = self.signs * found[:, [outputs.index(METRIC + name) for name in self.metrics]]
            some[failed[:, None] | np.isnan(some)] = -np.inf
            out[first : first + AT_ONCE] = some
        return out


def compare(question: Question, count: int) -> None:
    """Print how often a search passes the worst of random cases, by metric."""
    with tempfile.TemporaryDirectory() as folder:
        cases = Cases(question, Path(folder))
        began = time.monotonic()
        drawn = np.random.default_rng(1).random((count, cases.dimension))
        random = cases.values(drawn).min(axis=0)
        print(
            f"{question.deck}, {question.run}: {cases.dimension} dispersed, {time.monotonic() - began:.1f} s",
            flush=True,
        )
        for metric, name in enumerate(cases.metrics):
            found, after = [], []
            for seed in range(SEEDS):
                search = optimisers.hardest(cases.dimension, seed, SEARCHED)
                best, used, passed = np.inf, 0, None
                while len(points := search.ask()):
                    values = cases.values(points)[:, metric]
                    search.tell(values)
                    best, used = min(best, float(values.min())), used + len(points)
                    if passed is None and best <= random[metric]:
                        passed = used
                found.append(best)
                after += [passed] if passed is not None else []
            worst = cases.signs[metric] * np.array([random[metric], *found])
            spread = f"{worst[1:].min():.6g} .. {worst[1:].max():.6g}"
            print(
                f"  {name:8s} random {worst[0]:.6g}, searched {spread}: passed {len(after)} of {SEEDS}"
                + (f", after {int(np.median(after)):,} cases (median)" if after else ""),
                flush=True,
            )


if __name__ == "__main__":
    for each in QUESTIONS:
        compare(each, int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
