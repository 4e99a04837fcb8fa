"""`met plot --arm`: the arm of a case at some instants in one picture, the last one solid, with the path of its tip."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup, reading
from batch.arms.look import BASE, FIELD, LINK, PAYLOAD
from batch.arms.scene import ArmScene, arm_scene, lacking
from batch.plotting import layout
from batch.plotting.layout import COLOURS, LIGHT, PictureSheet
from batch.plotting.projection import PicturedSolid, Viewpoint, facets, solids, upright, viewpoint
from batch.queries.signals import case_text, number_text, panels
from met.diagnostic import Problem, error
from met.plan.channel import channel_paths
from met.program.courses import TIME

SHOWN, FITTED = 5, 48
"""Number of instants that are drawn by default, and of instants that determine the picture's frame."""

WIDTH, ASPECT = 8.6, 1.5
"""Width of a screen's picture in inches, and its ratio to the height."""

PATH, SHADOW, PAPER = "#0a5a9c", "#d5dade", "#ffffff"
PALE = 0.62
"""Share of the paper's colour in the first drawn instant; less in each later one."""

JOINTS = COLOURS[:-1]
EDGE, GLEAM = 0.55, 0.5


def arm_picture(
    archive: ArchiveFile, group: ArchiveGroup, case: str, instants: Sequence[float], sheet: PictureSheet
) -> Any:
    """The figure. instants: s; none: some over all of the run. Raises Problem E328, E370, E399."""
    from matplotlib.figure import Figure

    panels(group)  # refuses an archive without histories
    position = group.recorded_position(case) if case else int(group.recorded_positions[0])
    time, channels = _recorded(group, position)
    scene = _scene(archive, group, position, tuple(channels))
    rows = _instants(instants, time, case_text(group, position, varied=False))
    numbers = _outputs(archive, group, position, scene, channels, time)
    fitted = np.unique(np.linspace(0, len(time) - 1, FITTED).astype(int))
    everything = [solid for row in fitted for solid in solids(scene, numbers[row])]
    width = sheet.width or WIDTH
    height = sheet.height or width / ASPECT
    view = viewpoint(everything, width / height)
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0 if sheet.paper else 0.9))
    axes.set_axis_off()
    lowest = min(float(solid.ends[:, 2].min()) - solid.radius for solid in everything)
    floor = min(0.0, lowest) if not scene.moves else None
    if floor is not None:
        _floor(axes, scene, view, floor)
        _shadow(axes, list(solids(scene, numbers[rows[-1]])), view, floor)
    tip = numbers[:, -3:] @ upright(scene).T
    path = view.see(tip)
    axes.plot(path[:, 0], path[:, 1], color=PATH, linewidth=1.3, zorder=25)
    for number, row in enumerate(rows):
        pale = PALE * (1.0 - number / (len(rows) - 1)) + 0.12 * (number < len(rows) - 1) if len(rows) > 1 else 0.0
        _draw(axes, list(solids(scene, numbers[row])), view, pale, 3 + number)
        x, y = path[row, :2]
        axes.plot([x], [y], "o", color=PAPER, markeredgecolor=PATH, markersize=4, zorder=30)
    top = 0.9 * height if not sheet.paper else height
    axes.set(xlim=(-FIELD * width / height, FIELD * width / height), ylim=(-FIELD * top / height, FIELD * top / height))
    axes.set_aspect("equal", adjustable="datalim")
    times = ", ".join(number_text(float(time[row])) for row in rows)
    below = f"{case_text(group, position)} · at {times} s · grid {number_text(_step(scene.reach))} m"
    layout.title(figure, archive, group.name, below, sheet)
    return figure


def _recorded(group: ArchiveGroup, position: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times of a case's rows, s, and its channels by path, until its end or failure."""
    with reading(group.path):
        valid = int(group.values("n_valid")[position])
        channels: dict[str, np.ndarray] = {}
        for variable in group.role("signal"):
            values = group.signal(variable.name, position)[:valid].astype(np.float64)
            columns = values.reshape(valid, math.prod(values.shape[1:])).T
            paths = channel_paths(variable.name, group.joints(variable), group.components(variable))
            channels |= dict(zip(paths, columns, strict=True))
        return group.values("time")[:valid].astype(np.float64), channels


def _scene(archive: ArchiveFile, group: ArchiveGroup, position: int, recorded: Sequence[str]) -> ArmScene:
    plan = archive.plan(as_written=True)
    with reading(group.path):
        experiment = next(experiment for experiment in plan.experiments if experiment.name == group.name)
        scene = arm_scene(experiment, recorded)
    missing = lacking(scene, recorded)
    if missing:
        case = f"case #{int(group.values('case')[position])} of `{group.sweep or group.name}`"
        message = f"the arm of {case} cannot be shown: {', '.join(missing)} was not recorded"
        helps = f"`record += [{', '.join(missing)}]` in the run keeps where it is; then run it again"
        raise Problem(error("E370", message, help=helps))
    return scene


def _instants(instants: Sequence[float], time: np.ndarray, case: str) -> list[int]:
    """The rows to draw, in their order. Raises Problem E399."""
    if len(time) == 0:
        raise Problem(error("E399", f"{case} has no instant: it failed at once", help="`met show` says why"))
    first, last = float(time[0]), float(time[-1])
    for instant in instants:
        if not first <= instant <= last:
            rows = f"its rows are from {number_text(first)} s to {number_text(last)} s"
            message = f"{case} has no instant {number_text(instant)} s: {rows}"
            raise Problem(error("E399", message, help='`--at` takes an instant of these, `--at "1 s"`'))
    wanted = np.asarray(instants) if instants else np.linspace(first, last, SHOWN)
    return sorted({int(np.argmin(np.abs(time - instant))) for instant in wanted})


def _outputs(
    archive: ArchiveFile,
    group: ArchiveGroup,
    position: int,
    scene: ArmScene,
    channels: dict[str, np.ndarray],
    time: np.ndarray,
) -> np.ndarray:
    """Values of the scene's formulas, (row, output)."""
    values: dict[str, Any] = {v.path: float(group.at(v.name, [position])[0]) for v in group.role("coordinate")}
    values |= {name: channels[name] for name in scene.channels} | {TIME: time}
    for joint in scene.joints:
        q = channels[f"{joint}.q"]
        values |= {f"low:{joint}": min(0.0, float(q.min())), f"high:{joint}": max(0.0, float(q.max()))}
    with reading(group.path):
        inputs = {name: np.broadcast_to(np.asarray(values[name]), time.shape) for name in scene.formulas.inputs}
    outputs = scene.formulas.replay(inputs)
    return np.stack([np.broadcast_to(np.asarray(x, np.float64), time.shape) for x in outputs], axis=-1)


def _draw(axes: Any, pictured: Sequence[PicturedSolid], view: Viewpoint, pale: float, order: int) -> None:
    from matplotlib.collections import PolyCollection

    listed = [(facet, _colour(solid)) for solid in pictured for facet in facets(solid, view)]
    listed.sort(key=lambda facet_and_colour: -facet_and_colour[0].far)
    fills = [_mixed(colour, facet.light, pale) for facet, colour in listed]
    edges = [_mixed(colour, EDGE, pale) if facet.edge else "none" for facet, colour in listed]
    corners = [facet.corners for facet, _ in listed]
    axes.add_collection(PolyCollection(corners, facecolors=fills, edgecolors=edges, linewidths=0.5, zorder=order))


def _colour(solid: PicturedSolid) -> str:
    if solid.role == "joint" and solid.joint >= 0:
        return JOINTS[solid.joint % len(JOINTS)]
    return {"link": LINK, "payload": PAYLOAD}.get(solid.role, BASE)


def _mixed(colour: str, light: float, pale: float) -> tuple[float, float, float]:
    r, g, b = (
        (1.0 - pale) * min(1.0, light * int(colour[digit : digit + 2], 16) / 255.0) + pale for digit in (1, 3, 5)
    )  # towards white paper
    return (r, g, b)


def _step(reach: float) -> float:
    """The spacing of the grid, m: 1, 2 or 5 times a power of ten, about a quarter of the reach."""
    power = 10.0 ** math.floor(math.log10(reach / 4.0))
    return power * min((1.0, 2.0, 5.0, 10.0), key=lambda multiple: abs(multiple * power - reach / 4.0))


def _floor(axes: Any, scene: ArmScene, view: Viewpoint, height: float) -> None:
    from matplotlib.collections import LineCollection

    step = _step(scene.reach)
    count = math.ceil(1.3 * scene.reach / step)
    far, ends = count * step, np.arange(-count, count + 1) * step
    lines = [[(position, -far, height), (position, far, height)] for position in ends]
    lines += [[(-far, position, height), (far, position, height)] for position in ends]
    seen = view.see(np.array(lines))
    lines_seen = [line[:, :2] for line in seen if np.all(line[:, 2] > 0.0)]
    axes.add_collection(LineCollection(lines_seen, colors=LIGHT, linewidths=0.8, zorder=0))


def _shadow(axes: Any, pictured: Sequence[PicturedSolid], view: Viewpoint, height: float) -> None:
    from matplotlib.collections import PolyCollection

    flat = []
    for solid in pictured:
        ends = solid.ends * [1.0, 1.0, 0.0] + [0.0, 0.0, height]
        flat += facets(PicturedSolid("pill", "", -1, ends, solid.axes, solid.radius), view)[:1]
    axes.add_collection(PolyCollection([facet.corners for facet in flat], facecolors=SHADOW, linewidths=0.0, zorder=1))
