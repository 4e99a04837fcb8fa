"""Do intervals of fits hold the truth? Made arms, whose numbers are known, are logged with noise and fitted.

python -m tests.batch.fitting.truth FIRST LAST     arms FIRST to LAST - 1: what was missed, and shares by kind
python -m tests.batch.fitting.truth FIRST LAST late     the same with logs that are late, whose delay is estimated
"""

from __future__ import annotations

import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np

import batch
from batch.fitting.logged import DELAY
from batch.fitting.question import fit_question
from batch.modules.description import described_columns
from ic.driver.explain import explanations_of
from ic.driver.given_values import given_run

AXES = ("z", "y", "y", "x", "y", "x", "z")


def deck(draw: np.random.Generator, joints: int) -> str:
    """An arm of rods with a payload, whose joints swing under gravity."""
    lengths = draw.uniform(0.3, 1.5, joints)
    lines = ["deck 2;", "#include <servos/rigid_gearbox.ic>", "param payload = 1 kg;", "arm made {"]
    for k in range(joints):
        shape = f"rod(length = {lengths[k]:.3g} m, along = x)"
        lines.append(f"    link l{k} {{ mass = {draw.uniform(3.0, 40.0):.4g} kg;  shape = {shape}; }}")
        place = f"at = [{lengths[k - 1]:.3g} m, 0 m, 0 m];" if k else ""
        parent = f"l{k - 1}" if k else "base"
        lines.append(f"    joint j{k} revolute {{ parent = {parent};  child = l{k};  axis = {AXES[k]};  {place} }}")
    lines.append("}")
    for k in range(joints):
        course = f"amplitude = {draw.uniform(0.02, 0.06):.3g} rad/s, frequency = {draw.uniform(0.1, 0.5):.3g} Hz"
        gains = f"ratio = {draw.integers(300, 1600)};  kp = {draw.uniform(0.01, 0.04):.3g} V*s/rad;"
        lines.append(f"servo s{k} like rigid_gearbox {{ {gains}  command = rate(sine({course})); }}")
    servos = " ".join(f"j{k} = s{k};" for k in range(joints))
    lines += [
        "default run r {", "    arm = made;", f"    servos {{ {servos} }}",
        "    environment { gravity = [0, 0, -9.81] m/s^2; }",
        f"    payload load {{ on = l{joints - 1};  at = [{lengths[-1]:.3g}, 0, 0] m;  mass = payload;",
        "        shape = sphere(radius = 0.05 m); }",
        "    rates { dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }", "    duration = 10 s;",
        "    record = [q, tau, qd, servo.motor_torque];", "}", "",
    ]  # fmt: skip
    return "\n".join(lines)


def write_log(
    path: Path, sim: batch.Simulation, truth: dict[str, float], draw: np.random.Generator, delay: float = 0.0
) -> bool:
    """Log a run with noise, and half of all logs in steps; False where the run fails. delay: by how much it is late,
    s"""
    data = sim.run(truth, histories=True)
    noise, steps = float(draw.choice([0.002, 0.01, 0.03])), draw.random() < 0.5
    heads, columns = ["time [s]"], [data.time.values + delay]
    recorded = described_columns(sim.experiment)
    for signal in dict.fromkeys(each["signal"] for each in recorded):
        values = data[signal].values[0].reshape(len(data.time), -1)
        for each, exact in zip([one for one in recorded if one["signal"] == signal], values.T, strict=True):
            size = noise * exact.std()
            measured = exact + size * draw.standard_normal(len(exact))
            columns.append(np.round(measured / size) * size if steps and size else measured)
            heads.append(f"{each['channel']} [{each['unit']}]")
    rows = (",".join(repr(float(each)) for each in row) for row in np.array(columns).T)
    path.write_text("\n".join([",".join(heads), *rows, ""]))
    return int(data.status[0]) == 0


def main(first: int, last: int, late: bool) -> None:
    held, missed, unsure = Counter[str](), Counter[str](), 0
    for seed in range(first, last):
        draw = np.random.default_rng(seed)
        joints = int(draw.integers(2, 8))
        with tempfile.TemporaryDirectory() as folder:
            path, log = Path(folder) / "arm.ic", Path(folder) / "log.csv"
            path.write_text(deck(draw, joints))
            k = draw.integers(0, joints)
            names = [f"links.l{joints - 1}.mass", f"s{k}.f_c", "payload", f"s{joints - 1}.kt", f"s{k}.kp"]
            names = names[: draw.integers(2, 6)]
            compiled = given_run(path).compiled
            truth = {}
            for name in names:
                (value, *_) = (each.value for each in explanations_of(compiled, name))
                assert isinstance(value, float)
                truth[name] = value * float(draw.uniform(0.7, 1.4)) if name != "payload" else draw.uniform(0.5, 5.0)
            delay = draw.uniform(-0.05, 0.05) if late else 0.0
            if not write_log(log, batch.Simulation(path), truth, draw, delay):
                continue
            if late:
                names.append(f"{DELAY}{log}")
                truth[names[-1]] = delay
            answer = fit_question(str(path), [str(log)], names).answer(lambda _: None)
        fit = answer.fit
        if not fit.converged or fit.rival is not None or set(answer.known.verdict) != {"known"}:
            unsure += 1
            print(f"arm {seed}: not sure, and said so", flush=True)
            continue
        for name, value, deviation in zip(names, fit.values, fit.deviation, strict=True):
            off = abs(value - truth[name]) / (fit.factor * deviation)
            kind = "delay" if name.startswith(DELAY) else name.rpartition(".")[2]
            (held if off <= 1.0 else missed)[kind] += 1
            if off > 1.0:
                print(f"arm {seed}: {name} is off by {off:.2f} half intervals", flush=True)
    for kind in sorted(held | missed):
        print(f"{kind}: {held[kind]} of {held[kind] + missed[kind]} held")
    print(f"{held.total()} of {held.total() + missed.total()} held; {unsure} fits were not sure")


if __name__ == "__main__":
    main(*(int(each) for each in sys.argv[1:3]), late=sys.argv[3:] == ["late"])
