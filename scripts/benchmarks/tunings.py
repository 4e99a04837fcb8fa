"""Tunings with and without exact slopes: cases, how near they come to the best that is known, and their CPU time.

    python -m scripts.benchmarks.tunings [SEEDS [PROBLEM ...]]

The crane is that of docs/search.md, arms are shipped decks. The optimum of `spring` is known in closed form, and that
of others is the best of all tunings here and of one with four times the cases a seed. Steps are counted as cases; their
slopes are told apart. The last two columns are of the tunings with slopes: the median number of cases along them, and
how many of the seeds had two starts with goals within 2 % of one another.
"""

from __future__ import annotations

import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

import numpy as np

import ic
from batch.campaigns.points import with_cases
from batch.campaigns.searching import TuningSlopes
from batch.queries.search_answers import NEAR_BEST
from met import run as engine
from met.plan import Experiment
from met.searches import search_method, starts_of, steps_of
from met.searches.values import served

DOCS = Path(__file__).parents[2] / "docs"
CRANE = (DOCS / "search.md").read_text().split("<!-- crane.ic -->\n```c\n")[1].split("tune gains")[0]
FIRST_SEED = 100
"""Those below were used while the method's constants were chosen, on these problems."""

KP, KI = "logbetween(0.05, 3) V*s/rad", "logbetween(0.05, 3) V/rad"
SPRING = """
arm slider {
    link block { mass = 2 kg;  shape = sphere(radius = 0.1 m); }
    joint slide prismatic { parent = base;  child = block;  axis = x; }
}
run swing {
    arm = slider;  initial { q = 0.1 m; }
    environment { held = spring { link = block;  stiffness = 40 N/m;  damping = DAMPING N*s/m; } }
    rates { dynamics = 200 Hz;  record = 10 Hz; }  integrator = rk4;  duration = LASTS s;  record = [q];
    metric off = final { of = abs(slide.q); }
    metric shake = rms { of = slide.q; }
    metric fast = peak { of = slide.qd; }
    require fast < FASTEST m/s;
}
sweep loads of swing { vary links.block.mass = [2, 1, 1.5, 3, 2.5] kg; }
"""
TWO_LINK = """#include <two_link.ic>
run track like nominal {
    remove settle;
    metric miss = rms { of = abs(shoulder.qd - slow) + abs(elbow.qd - slow); }
    metric past = overshoot { of = elbow.qd;  target = slow; }
    require past < 15 %;
}
sweep loads of RUN { zip { links.upper.mass = [40, 50, 60] kg;  links.lower.mass = [20, 30, 25] kg; } }
"""


def _gains(joints: list[str], kp: str, ki: str) -> str:
    return "".join(f"choose {joint}.servo.kp = {kp};  choose {joint}.servo.ki = {ki};  " for joint in joints)


PROBLEMS = {
    "spring": SPRING.replace("DAMPING", "0").replace("LASTS", "1").replace("FASTEST", "10") + """
tune t of swing {
    choose environment.held.stiffness = between(2, 9) N/m;  against loads;  minimise off;  at_most = 300;
}
""",
    "spring and damper": SPRING.replace("DAMPING", "2").replace("LASTS", "3").replace("FASTEST", "0.25") + """
tune t of swing {
    choose environment.held.stiffness = logbetween(1, 100) N/m;
    choose environment.held.damping = logbetween(0.1, 50) N*s/m;
    against loads;  minimise shake;  at_most = 1000;
}
""",
    "crane, settling": CRANE + """
tune t of reach {
    choose drive.kp = logbetween(0.05, 1) V*s/rad;  choose drive.ki = logbetween(0.05, 1) V/rad;
    against spread;  minimise settle;  at_most = 3000;
}
""",
    "crane, rms": CRANE + f"""
run track like reach {{
    remove settle;  metric miss = rms {{ of = slew.qd - slow; }}
    metric volts = peak {{ of = slew.servo.voltage; }}  require volts < 18 V;
}}
sweep wide of track {{
    sample random(16) {{
        payloads.load.mass = uniform(0.5, 25) kg;  drive.kt = truncated(0.061, 0.002, 0.055, 0.067) N*m/A;
    }}
}}
tune t of track {{ choose drive.kp = {KP};  choose drive.ki = {KI};  against wide;  minimise miss;  at_most = 2000; }}
""",
    "crane, six gains": CRANE + f"""
run track like reach {{
    remove settle;  metric miss = rms {{ of = abs(slew.qd - slow) + abs(luff.qd - slow) + abs(fold.qd - slow); }}
}}
sweep wide of track {{ sample random(16) {{ payloads.load.mass = uniform(0.5, 25) kg; }} }}
tune t of track {{ {_gains(["slew", "luff", "fold"], KP, KI)} against wide;  minimise miss;  at_most = 3000; }}
""",
    "two-link arm, settling": TWO_LINK.replace("RUN", "nominal") + """
tune t of nominal {
    choose gearbox.kp = between(0.01, 0.1) V*s/rad;  choose gearbox.ki = between(0.06, 1) V/rad;
    against loads;  minimise settle;  at_most = 1500;
}
""",
    "two-link arm, four gains": TWO_LINK.replace("RUN", "track") + f"""
tune t of track {{
    {_gains(["shoulder", "elbow"], "between(0.01, 0.1) V*s/rad", "between(0.06, 1) V/rad")}
    against loads;  minimise miss;  at_most = 2000;
}}
""",
    "counterweight": """
arm crane { link upper { mass = 40 kg;  shape = rod(length = 2 m, along = x); }
            joint pitch revolute { parent = base;  child = upper;  axis = y; } }
servo drive {
    model = ideal;  bandwidth = 50 1/s;
    command = position(sine(offset = 0 deg, amplitude = 40 deg, frequency = 0.4 Hz));
}
run sway {
    arm = crane;  servos { pitch = drive; }
    payload weight { on = upper;  at = [-0.5, 0, 0] m;  mass = 50 kg;  shape = sphere(radius = 0.15 m); }
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates { dynamics = 200 Hz;  servos = 200 Hz;  record = 50 Hz; }  duration = 5 s;  record = [q];
    metric effort = rms { of = pitch.tau; }
}
sweep hands of sway { vary links.upper.mass = [35, 40, 45, 50] kg; }
tune t of sway {
    choose payloads.weight.mass = between(10, 150) kg;  choose payloads.weight.at.x = between(-1.5, -0.2) m;
    against hands;  minimise effort;  at_most = 1000;
}
""",
    "Manutec r3, a move": """#include <manutec_r3.ic>
run hurried like manutec_r3_move {
    servos { joint1 = r3_drive1 {
        command = position(trapezoid(start = -60 deg, to = 60 deg, max_rate = 1.6 rad/s, max_acceleration = 6 rad/s^2));
    } }
    rates { dynamics = 500 Hz;  servos = 500 Hz;  record = 50 Hz; }
    remove effort;  remove fast;  metric swing = peak { of = joint1.tau; }  require swing < 700 N*m;
}
tune t of hurried {
    choose joint1.servo.command.max_rate = between(0.5, 4) rad/s;
    choose joint1.servo.command.max_acceleration = between(2, 30) rad/s^2;  minimise settle;  at_most = 800;
}
""",
    "Panda, eight gains": f"""#include <panda.ic>
run fine like reach {{
    rates {{ dynamics = 500 Hz;  servos = 500 Hz;  record = 50 Hz; }}  remove settle;
    metric miss = rms {{ of = {" + ".join(f"abs(joint{n}.q - joint{n}.servo.command)" for n in (1, 2, 3, 4))}; }}
}}
sweep wide of fine {{ sample random(8) {{ links.load.mass = uniform(0.1, 3) kg; }} }}
tune t of fine {{
    {_gains([f"joint{n}" for n in (1, 2, 3, 4)], "logbetween(0.01, 0.3) V*s/rad", "logbetween(0.2, 10) V/rad")}
    against wide;  minimise miss;  at_most = 1600;
}}
""",
}  # fmt: skip


Tuned = tuple[int, int, float, float, bool]


def tuned(experiment: Experiment, prepared: engine.Prepared, slopes: TuningSlopes) -> Tuned:
    """Cases, those along slopes, the goal in the worst plant of the best candidate, seconds of CPU, and whether two
    starts agree."""
    search = experiment.search
    assert search is not None
    begun, method = time.process_time(), search_method(search, slopes)
    cases, worths = [], []
    while len(generation := method.ask()):
        program = prepared.of_cases(with_cases(experiment, generation))
        run = _run(program)
        goal = run.metrics[search.metric]
        done = run.status == engine.DONE
        worth = served(goal, search.largest, done, experiment.requirements, run.metrics, search.margin)
        method.tell(worth)
        cases.append(generation)
        worths.append(worth)
    seconds, table = time.process_time() - begun, np.concatenate(cases)
    _, candidate, tried = np.unique(table[:, : len(search.parameters)], axis=0, return_inverse=True, return_counts=True)
    worst, worth = np.full(len(tried), -np.inf), np.concatenate(worths)
    np.maximum.at(worst, candidate.ravel(), worth)
    best = float(worst[tried == max(1, len(search.plants))].min())
    goal_there = best / (1.0 - abs(best)) if abs(best) < 1.0 else np.inf
    reached = np.sort([worth[start.best] for start in starts_of(method, search, table, worth) if start.best >= 0])
    goals = (reached / (1.0 - np.abs(reached)))[:2]
    agree = len(goals) == 2 and bool(goals[1] - goals[0] <= NEAR_BEST * abs(goals[0]))
    return len(table), steps_of(method).get("along_slopes", 0), goal_there, seconds, agree


def _run(program: engine.Prepared) -> engine.Run:
    experiment = program.experiment
    rows = np.arange(experiment.cases.count)
    ticks = experiment.structure.schedule.ticks
    _, outputs = program.kernel.run(engine.inputs(experiment, rows), ticks, record=False)
    return engine.results(program, rows, None, outputs, {})


def compare(name: str, seeds: int) -> None:
    """Print a row of the table for a problem."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "deck.ic")
        path.write_text(PROBLEMS[name])
        experiment = ic.compile(path, select=["t"]).experiments[0]
    search = experiment.search
    assert search is not None
    prepared, slopes = engine.prepare(experiment), TuningSlopes(experiment)
    prepared.kernel  # noqa: B018  # compiled before time is taken
    first = np.array([np.asarray(coordinate.values)[:1] for coordinate in experiment.cases.coordinates]).T
    slopes.slopes(first)
    results_of: dict[str, list[Tuned]] = {"off": [], "on": [], "long": []}
    for seed in range(FIRST_SEED, FIRST_SEED + seeds):
        for way, gradients, times in (("off", False, 1), ("on", True, 1), ("long", False, 4)):
            variant = replace(search, seed=seed, gradients=gradients, at_most=times * search.at_most)
            results_of[way].append(tuned(replace(experiment, search=variant), prepared, slopes))
    best = min(result[2] for rows in results_of.values() for result in rows)
    row = [f"{len(search.parameters)} by {max(1, len(search.plants))}"]
    for way in ("off", "on", "long"):
        off = [100.0 * (result[2] / best - 1.0) for result in results_of[way]]
        cases, seconds = (median(result[n] for result in results_of[way]) for n in (0, 3))
        row += [f"{cases:,.0f}", f"{_share(median(off))} ({_share(max(off))})", f"{seconds:.2g} s"]
    along, agree = median(result[1] for result in results_of["on"]), sum(result[4] for result in results_of["on"])
    print(f"| {name} | {row[0]} | " + " | ".join(row[1:]) + f" | {along:.0f} | {agree} |", flush=True)


def _share(percent: float) -> str:
    return "< 0.001 %" if 0.0 < percent < 0.001 else f"{percent:.2g} %"


def main() -> None:
    """Compare all problems, or those that are named."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    for name in sys.argv[2:] or PROBLEMS:
        compare(name, seeds)


if __name__ == "__main__":
    main()
