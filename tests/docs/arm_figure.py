"""The picture of README.md: the Panda of the shipped deck at work, drawn from the frames of its links.

python -m tests.docs.arm_figure          writes docs/figures/panda.png
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Line3DCollection

import batch
import ic

ROOT = Path(__file__).parents[2]
PICTURE = ROOT / "docs" / "figures" / "panda.png"
SHOWN = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 5.0)
"""Times at which the whole arm is drawn, s."""
LABEL_GAP = 11.0
"""The least distance of two joints' names beside their curves, deg."""


def draw(path: Path) -> np.ndarray:
    """Run the deck and draw it into a PNG file; returns the corners of the arm [time, joint, axis], m, world axes."""
    with tempfile.TemporaryDirectory() as folder:
        archive = batch.run(ic.compile(ROOT / "ic" / "decks" / "panda.ic"), output=Path(folder) / "panda.h5")
        data = archive.open()
        frames = data.met.frames().isel(recorded_case=0).load()
        angles = np.degrees(data["q"].isel(recorded_case=0).values)
        names = data["joint"].values
        data.close()
    links = frames["position"].values
    corners = np.concatenate([np.zeros_like(links[:, :1]), links], axis=1)  # from the base on
    times = frames["time"].values
    figure = Figure(figsize=(10.4, 4.0), dpi=130)
    _arm(figure.add_axes((-0.03, -0.1, 0.62, 1.2), projection="3d"), times, corners)
    _angles(figure.add_axes((0.60, 0.13, 0.33, 0.74)), times, angles, names)
    figure.savefig(path, metadata={"Software": None})
    return corners


def _arm(axes: Any, times: np.ndarray, corners: np.ndarray) -> None:
    shades = colormaps["Blues"](np.linspace(0.25, 1.0, len(SHOWN)))
    for instant, shade in zip(SHOWN, shades, strict=True):
        x, y, z = corners[np.searchsorted(times, instant - 1e-9)].T
        last = instant == SHOWN[-1]
        axes.plot(
            x, y, z, color=shade, linewidth=5.0 if last else 3.0, solid_capstyle="round", alpha=1.0 if last else 0.75
        )
        axes.scatter(x, y, z, color="white", edgecolor=shade, s=26 if last else 12, depthshade=False, linewidth=1.2)
    tip = corners[:, -1]
    path = np.stack([tip[:-1], tip[1:]], axis=1)
    axes.add_collection3d(Line3DCollection(path, colors="#d1495b", linewidths=1.6))
    for at in np.linspace(-0.6, 0.9, 6):
        axes.plot([-0.6, 0.9], [at, at], [0, 0], color="#dddddd", linewidth=0.6, zorder=0)
        axes.plot([at, at], [-0.6, 0.9], [0, 0], color="#dddddd", linewidth=0.6, zorder=0)
    axes.set(xlim=(-0.2, 0.85), ylim=(-0.3, 0.75), zlim=(-0.02, 0.93))
    axes.set_box_aspect((1.05, 1.05, 0.95), zoom=1.45)
    axes.view_init(elev=18, azim=-22)
    axes.set_axis_off()


def _angles(axes: Any, times: np.ndarray, angles: np.ndarray, names: np.ndarray) -> None:
    shades = colormaps["viridis"](np.linspace(0.0, 0.9, len(names)))
    height = -np.inf  # of the label below
    for joint in np.argsort(angles[-1]):
        axes.plot(times, angles[:, joint], color=shades[joint], linewidth=1.6)
        height = max(angles[-1, joint], height + LABEL_GAP)
        axes.text(times[-1] + 0.08, height, names[joint], va="center", fontsize=8, color=shades[joint])
    axes.set_xlabel("time in s")
    axes.set_title("q in deg", loc="left", fontsize=10)
    axes.grid(alpha=0.3)
    axes.margins(x=0.0)
    axes.spines[["top", "right"]].set_visible(False)


if __name__ == "__main__":
    draw(PICTURE)
    print(PICTURE)
