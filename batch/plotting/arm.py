"""`met plot --arm`: the arm of a case at some instants in one picture, the last one solid, with the path of its tip."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile, ArchiveGroup, reading
from batch.arms.look import AZIMUTH, BASE, CUBE, FIELD, FLAT, FOOT, HIGH, JOINT, LINK, LOW, PAYLOAD, RAIL, ROOM
from batch.arms.scene import POSE_NUMBERS, SHAPE_NUMBERS, ArmScene, arm_scene, lacking
from batch.plotting import layout
from batch.plotting.layout import COLOURS, LIGHT, PictureSheet
from batch.queries.signals import case_text, number_text, panels
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan.channel import channel_paths
from met.program.courses import TIME

ROUND = 28
"""Number of corners of a circle."""


@frozen
class PicturedSolid:
    """A solid in the world, z up, m: a "pill" or "can" from one end to another, or a "block" of three edges.

    ends    of its axis (2, 3);  axes: of a block, rows, each half an edge long
    """

    kind: str
    role: str
    joint: int
    ends: np.ndarray
    axes: np.ndarray
    radius: float


def upright(scene: ArmScene) -> np.ndarray:
    """The rotation that takes the world's axes to those in which `up` is z."""
    return np.stack(_along(np.array(scene.up)), axis=0) if scene.up != (0.0, 0.0, 1.0) else np.eye(3)


def solids(scene: ArmScene, numbers: np.ndarray) -> Iterator[PicturedSolid]:
    """The arm at an instant. numbers: the outputs of the scene's formulas there."""
    up, limb = upright(scene), scene.limb
    count = POSE_NUMBERS * len(scene.bodies)
    poses, shape_numbers = numbers[:count].reshape(-1, POSE_NUMBERS), numbers[count:-3].reshape(-1, SHAPE_NUMBERS)
    for shape, (*middle_and_axis, x, y, z) in zip(scene.shapes, shape_numbers, strict=True):
        R, p = up @ poses[shape.body][:9].reshape(3, 3), up @ poses[shape.body][9:]
        middle, axis = p + R @ np.array(middle_and_axis[:3]), R @ np.array(middle_and_axis[3:])
        length, radius, kind = float(np.linalg.norm(axis)), limb, "pill"
        way = axis / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        axes = np.zeros((3, 3))
        if shape.kind == "line":
            middle = middle + axis / 2.0
        elif shape.kind == "sphere":
            length, radius = 0.0, x
        elif shape.kind == "box":
            kind, edges = "block", np.full(3, CUBE * limb) if shape.role == "joint" else np.array([x, y, z])
            axes = 0.5 * edges[:, None] * R.T
            length, radius, way = float(edges[2]), float(math.hypot(edges[0], edges[1])) / 2.0, R[:, 2]
        else:
            length = z
            if shape.kind == "cylinder":
                kind, radius = "can", x
                if shape.role == "joint":
                    radius, length = JOINT[0] * limb, JOINT[1] * limb
        radius = RAIL * limb if shape.role == "rail" else radius
        ends = np.stack([middle - way * length / 2.0, middle + way * length / 2.0])
        yield PicturedSolid(kind, shape.role, shape.joint, ends, axes, radius)
    if not scene.moves:
        foot = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, FOOT[1] * limb]])
        yield PicturedSolid("can", "base", -1, foot, np.zeros((3, 3)), FOOT[0] * limb)


@frozen
class Viewpoint:
    """A viewpoint of a picture: right, up and back (to the eye) in the world, and the eye."""

    right: np.ndarray
    up: np.ndarray
    back: np.ndarray
    eye: np.ndarray

    def see(self, points: np.ndarray) -> np.ndarray:
        """Points (..., 3) as right, up and far (..., 3): the first two by the distance, without a unit."""
        v = points - self.eye
        far = -(v @ self.back)
        return np.stack([(v @ self.right) / far, (v @ self.up) / far, far], axis=-1)


def viewpoint(pictured: Sequence[PicturedSolid], aspect: float) -> Viewpoint:
    """The direction from which the spread of these solids is seen best, from higher where it is flat; at such a
    distance that all are seen in a picture of this ratio of width to height."""
    points = np.concatenate([solid.ends for solid in pictured])
    radii = np.repeat([solid.radius for solid in pictured], 2)
    spread = np.cov(points.T, bias=True)
    across = float(spread[0, 0] + spread[1, 1])
    elevation = HIGH if spread[2, 2] < FLAT * across else LOW

    def area(azimuth: float) -> float:
        """The area over which the solids are spread as seen from this azimuth; near `AZIMUTH` it counts for more."""
        plane = np.stack(_axes(azimuth, elevation)[:2])
        return float(np.linalg.det(plane @ spread @ plane.T)) + 1e-3 * (1.0 + math.cos(azimuth - AZIMUTH)) * across**2

    azimuth = max((AZIMUTH + number * math.pi / 18.0 for number in range(36)), key=area)
    right, up, back = _axes(azimuth, elevation)
    middle = [
        (float(np.min(points @ axis - radii)) + float(np.max(points @ axis + radii))) / 2.0 for axis in (right, up)
    ]
    target = right * middle[0] + up * middle[1] + back * float(np.mean(points @ back))
    v = points - target
    sides = np.maximum((np.abs(v @ right) + radii) / (FIELD * aspect), (np.abs(v @ up) + radii) / FIELD)
    return Viewpoint(right, up, back, target + back * ROOM * float(np.max(v @ back + sides)))


@frozen
class Facet:
    """A polygon of the picture (corner, 2); light: how it is lit, 1 fully; far: its distance, by which it is sorted."""

    corners: np.ndarray
    light: float
    far: float
    edge: bool = True


def facets(solid: PicturedSolid, view: Viewpoint) -> list[Facet]:
    """The polygons of a solid, back to front."""
    key = view.back - 0.7 * view.right + view.up
    key = key / np.linalg.norm(key)

    def lit(normal: np.ndarray) -> float:
        return 0.62 + 0.42 * (0.5 + 0.5 * float(normal @ key))

    ends = view.see(solid.ends)
    far = float(ends[:, 2].mean())
    turn = 2.0 * math.pi * np.arange(ROUND) / ROUND
    if solid.kind == "block":
        out = []
        middle = solid.ends.mean(axis=0)
        for k in range(3):
            for sign in (1.0, -1.0):
                face, (u, v) = middle + sign * solid.axes[k], (solid.axes[(k + 1) % 3], solid.axes[(k + 2) % 3])
                if sign * solid.axes[k] @ (view.eye - face) > 0.0:
                    normal = sign * solid.axes[k] / np.linalg.norm(solid.axes[k])
                    corners = view.see(np.stack([face + u + v, face - u + v, face - u - v, face + u - v]))
                    out.append(Facet(corners[:, :2], lit(normal), far))
        return out
    if solid.kind == "can":
        x, y, z = _along(solid.ends[1] - solid.ends[0])
        circle = solid.radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
        rings = [view.see(end + circle)[:, :2] for end in solid.ends]
        near = 1 if z @ (view.eye - solid.ends.mean(axis=0)) > 0.0 else 0
        top = lit(z if near else -z)
        return [Facet(hull(np.concatenate(rings)), 0.86, far), Facet(rings[near], top, far - 1e-9)]
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    radii = solid.radius / ends[:, 2]
    body = hull(np.concatenate([end[:2] + r * circle for end, r in zip(ends, radii, strict=True)]))
    gleam = [end[:2] + r * (0.13 * circle + [-0.28, 0.28]) for end, r in zip(ends, radii, strict=True)]
    return [Facet(body, 0.95, far), Facet(hull(np.concatenate(gleam)), 1.12, far - 1e-9, edge=False)]


def hull(points: np.ndarray) -> np.ndarray:
    """The corners round all points (Andrew's monotone chain)."""
    order = points[np.lexsort((points[:, 1], points[:, 0]))]

    def chain(rows: np.ndarray) -> list[np.ndarray]:
        """The convex chain along one side of sorted points, without its last point."""
        out: list[np.ndarray] = []
        for p in rows:
            while len(out) > 1 and _side(out[-2], out[-1], p) <= 0.0:
                out.pop()
            out.append(p)
        return out[:-1]

    return np.array([*chain(order), *chain(order[::-1])])


def _side(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> float:
    """Twice the area of the triangle of three points of a plane; above 0 if c is left of the way from a to b."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _axes(azimuth: float, elevation: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Right, up and back (to the eye) in the world, z up, of a view from this direction, rad."""
    ca, sa, ce, se = math.cos(azimuth), math.sin(azimuth), math.cos(elevation), math.sin(elevation)
    back, right = np.array([ce * ca, ce * sa, se]), np.array([-sa, ca, 0.0])
    return right, np.cross(back, right), back


def _along(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Three axes of which the last is along a direction."""
    z = axis / (np.linalg.norm(axis) or 1.0)
    x = np.cross([0.0, 0.0, 1.0] if abs(z[2]) < 0.9 else [1.0, 0.0, 0.0], z)
    x = x / np.linalg.norm(x)
    return x, np.cross(z, x), z


SHOWN, FITTED = 5, 48
"""Number of instants that are drawn by default, and of instants that determine the picture's frame."""

WIDTH, ASPECT = 8.6, 1.5
"""Width of a screen's picture in inches, and its ratio to the height."""

PATH, SHADOW, PAPER = "#0a5a9c", "#d5dade", "#ffffff"
PALE = 0.62
"""Share of the paper's colour in the first drawn instant; less in each later one."""

JOINTS = COLOURS[:-1]
EDGE = 0.55
"""Light on the edges of facets, relative to their colour."""


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
    """The scene of a case's arm: its solids and their formulas. Raises Problem E370 where a channel that it needs was
    not recorded."""
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
    """Values of the scene's formulas at each row of a case's history, [row, output]."""
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
    """Draw solids from the far to the near. pale: how much lighter than their colours; order: among what else is
    drawn"""
    from matplotlib.collections import PolyCollection

    listed = [(facet, _colour(solid)) for solid in pictured for facet in facets(solid, view)]
    listed.sort(key=lambda facet_and_colour: -facet_and_colour[0].far)
    fills = [_mixed(colour, facet.light, pale) for facet, colour in listed]
    edges = [_mixed(colour, EDGE, pale) if facet.edge else "none" for facet, colour in listed]
    corners = [facet.corners for facet, _ in listed]
    axes.add_collection(PolyCollection(corners, facecolors=fills, edgecolors=edges, linewidths=0.5, zorder=order))


def _colour(solid: PicturedSolid) -> str:
    """The colour of a solid: of a joint that of its line in plots, of others by what they are."""
    if solid.role == "joint" and solid.joint >= 0:
        return JOINTS[solid.joint % len(JOINTS)]
    return {"link": LINK, "payload": PAYLOAD}.get(solid.role, BASE)


def _mixed(colour: str, light: float, pale: float) -> tuple[float, float, float]:
    """A colour `#rrggbb` as red, green and blue, 0 to 1, lit and then made paler. pale: share of white, 0 to 1"""
    r, g, b = (
        (1.0 - pale) * min(1.0, light * int(colour[digit : digit + 2], 16) / 255.0) + pale for digit in (1, 3, 5)
    )  # towards white paper
    return (r, g, b)


def _step(reach: float) -> float:
    """The spacing of the grid, m: 1, 2 or 5 times a power of ten, about a quarter of the reach."""
    power = 10.0 ** math.floor(math.log10(reach / 4.0))
    return power * min((1.0, 2.0, 5.0, 10.0), key=lambda multiple: abs(multiple * power - reach / 4.0))


def _floor(axes: Any, scene: ArmScene, view: Viewpoint, height: float) -> None:
    """Draw the grid of a floor at a height, m."""
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
    """Draw the shadow of solids on the floor at a height, m."""
    from matplotlib.collections import PolyCollection

    flat = []
    for solid in pictured:
        ends = solid.ends * [1.0, 1.0, 0.0] + [0.0, 0.0, height]
        flat += facets(PicturedSolid("pill", "", -1, ends, solid.axes, solid.radius), view)[:1]
    axes.add_collection(PolyCollection([facet.corners for facet in flat], facecolors=SHADOW, linewidths=0.0, zorder=1))
