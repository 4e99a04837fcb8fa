"""The paper's test over the wire: figures 7 and 8 beside the band of 20 seeds of the emulated bed.

    python -m tests.batch.beds.paper          writes docs/figures/bed_figures_7_8.png
    python -m tests.batch.beds.paper free     says how runs in real time lie in the band, on this machine

The bed is the firmware on an emulated Cortex-M3, at the other end of a pseudo-terminal; so `met bed run` knows it as a
serial line. Figures are of lock-step, which has the same bits each time.
"""

from __future__ import annotations

import os
import select
import socket
import subprocess
import sys
import tempfile
import threading
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scipy import stats

import batch
import ic
from hw.beds.simulated import config_of
from hw.boards.build import build, qemu
from met import cli
from met.plan import Experiment
from met.plant import bed_values, plant_c

FIGURE = Path(__file__).parents[3] / "docs" / "figures" / "bed_figures_7_8.png"
SLOW, SEEDS = 0.03, 20

DECK = f"""\
#include <two_link.ic>
run wired like hybrid {{
    remove settle;
    remove volts;
    record = [q, qd, tau, shoulder.servo.voltage, shoulder.bed.load_current];
    seed   = 1;
}}
run fast like wired {{
    rates {{ dynamics = 1 kHz;  servos = 1 kHz;  record = 100 Hz; }}
    shoulder {{ bed = emulated(faults = typical, delay = 1); }}
}}
sweep band of wired {{ seed = 0;  repeat {SEEDS}; }}
sweep fast_band of fast {{ seed = 0;  repeat {SEEDS}; }}
"""


def deck(folder: Path) -> Path:
    path = folder / "paper.ic"
    path.write_text(DECK, encoding="utf-8")
    return path


def driven(source: Path, name: str, output: Path, *words: str) -> Path:
    """`met bed run`; the archive."""
    told = ["bed", "run", str(source), name, "-o", str(output), "--no-picture", "--quiet", *words]
    assert cli.main(told) == cli.YES, told
    return output


@contextmanager
def cortex_m3(experiment: Experiment, folder: Path, *, period: float, lock_step: bool) -> Iterator[str]:
    """The firmware with the shoulder's bed in an emulator; the name of a terminal that it is behind."""
    config = config_of(bed_values(experiment, "shoulder", 0), period, lock_step=lock_step)
    command = qemu(build("arm", config, plant_c(experiment, "shoulder", period=period)), folder / "line")
    own, theirs = os.openpty()
    tty.setraw(theirs)
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as process, socket.socket(socket.AF_UNIX) as line:
        try:
            end = time.monotonic() + 20.0
            while line.connect_ex(str(folder / "line")):
                assert process.poll() is None and time.monotonic() < end
                time.sleep(0.01)
            done = threading.Event()
            relay = threading.Thread(target=_relayed, args=(own, line.fileno(), done))
            relay.start()
            yield os.ttyname(theirs)
            done.set()
            relay.join()
        finally:
            process.kill()
            os.close(own)
            os.close(theirs)


def _relayed(one: int, other: int, done: threading.Event) -> None:
    while not done.is_set():
        for file in select.select([one, other], [], [], 0.1)[0]:
            os.write(other if file == one else one, os.read(file, 4096))


def rates(archive: Path) -> np.ndarray:
    """Of both joints, rad/s: [case, time, joint]."""
    data = batch.open(archive)
    assert not data.status.values.any(), data.cause.values
    found: np.ndarray = data.qd.values
    return found


def reach(seeds: np.ndarray) -> np.ndarray:
    """How far from the seeds' mean another one is expected to be, at most, 95 times in 100: [time, joint]."""
    share = stats.t.ppf(0.975, len(seeds) - 1) * np.sqrt(1.0 + 1.0 / len(seeds))
    found: np.ndarray = share * seeds.std(axis=0, ddof=1)
    return found


def inside(run: np.ndarray, seeds: np.ndarray) -> np.ndarray:
    """Share of the instants after the first ones, where both are at rest, at which a run is in the band: [joint]."""
    band = reach(seeds)
    moving = band.min(axis=1) > 0.0
    assert moving.sum() > 0.95 * len(moving)
    found: np.ndarray = (np.abs(run - seeds.mean(axis=0)) <= band)[moving].mean(axis=0)
    return found


def at_the_paper_s_rates(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Instants [time], the run behind the terminal [time, joint], seeds of the emulated bed [seed, time, joint]."""
    source = deck(folder)
    experiment = ic.compile(source, select=["wired"]).experiments[0]
    with cortex_m3(experiment, folder, period=0.002, lock_step=True) as terminal:
        run = driven(source, "wired", folder / "wire.h5", "--port", terminal, "--lock-step")
    seeds = driven(source, "band", folder / "band.h5", "--port", "emulated")
    return batch.open(run).time.values, rates(run)[0], rates(seeds)


def draw(path: Path) -> None:
    from matplotlib.figure import Figure

    from tests.paper.figures import BEHIND, INK, LINE, MUTED, SURFACE

    with tempfile.TemporaryDirectory() as folder:
        instants, run, seeds = at_the_paper_s_rates(Path(folder))
    mean, band = seeds.mean(axis=0), reach(seeds)
    figure = Figure(figsize=(9.0, 5.4), dpi=150, facecolor=SURFACE, layout="constrained")
    figure.suptitle(
        "The paper's figures 7 and 8 over the wire: servos 100 Hz, wire 500 Hz, dynamics 25 Hz",
        x=0.01,
        ha="left",
        color=INK,
        fontsize=11,
    )
    grid = figure.subplots(2, 2, width_ratios=(1.7, 1.0), sharex="col")
    for joint, (whole, near) in enumerate(grid):
        for axes, scale, level in ((whole, 1.0, 0.0), (near, 100.0 / SLOW, mean[:, joint])):
            low, high = (scale * (mean[:, joint] + side * band[:, joint] - level) for side in (-1.0, 1.0))
            axes.fill_between(
                instants,
                low,
                high,
                color=BEHIND,
                alpha=0.35,
                linewidth=0.0,
                label=f"95 % of {SEEDS} seeds, emulated bed",
            )
            axes.plot(
                instants,
                scale * (run[:, joint] - level),
                color=LINE,
                linewidth=0.9,
                label="firmware on a Cortex-M3 (QEMU)",
            )
            axes.set_facecolor(SURFACE)
            axes.grid(color=MUTED, alpha=0.15, linewidth=0.8)
            axes.tick_params(colors=MUTED)
            axes.spines[["top", "right"]].set_visible(False)
        whole.set_title(f"Joint {joint + 1} ({('shoulder', 'elbow')[joint]})", loc="left", color=INK, fontsize=9)
        whole.set_ylabel("joint rate, rad/s", color=MUTED)
        whole.set_xlim(0.0, 20.0)
        whole.set_ylim(0.0, 0.034)
        whole.legend(loc="lower right", frameon=False, labelcolor=INK, fontsize=9)
        near.set_title("off the seeds' mean, near to", loc="left", color=INK, fontsize=9)
        near.set_ylabel("% of the rate asked", color=MUTED)
        near.set_xlim(12.0, 14.0)
        span = 1.2 * 100.0 / SLOW * band[(instants >= 12.0) & (instants <= 14.0), joint].max()
        near.set_ylim(-span, span)
    for axes in grid[1]:
        axes.set_xlabel("time, s", color=MUTED)
    figure.savefig(path, metadata={"Software": None})


def measure_free() -> None:
    """Shares of both joints inside the band: in real time, at the paper's rates and at 1 kHz."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        source = deck(folder)
        driven(source, "band", folder / "wired.h5", "--port", "emulated")
        batch.run(ic.compile(source, select=["fast_band"]), output=folder / "fast.h5")
        for name, port in (("wired", "firmware"), ("wired", "qemu"), ("fast", "firmware")):
            for turn in range(3):
                output = folder / f"{name}.{port}.{turn}.h5"
                words = ["bed", "run", str(source), name, "-o", str(output), "--no-picture", "--port", port]
                if cli.main(words) == cli.YES:
                    shares = inside(rates(output)[0], rates(folder / f"{name}.h5"))
                    print(f"{name} {port}: inside the band {shares[0]:.1%}, {shares[1]:.1%}", flush=True)


if __name__ == "__main__":
    if sys.argv[1:] == ["free"]:
        measure_free()
    else:
        draw(FIGURE)
        print(FIGURE)
