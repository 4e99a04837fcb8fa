"""Poses of links, from the q of a Dataset and the plan in its archive, by the same functions as for exports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray

from batch.archive.read import ArchiveGroup
from batch.arms.scene import OF_FREE_BASE, POSITION, free_pose, parameters, prescribed_pose, world_poses
from batch.export.poses import lacking_help, lacking_text, pose_variables
from batch.notebook.quantities import number
from batch.notebook.table import CASE, NO_HISTORIES, RECORDED, experiment, path_of, places, run_name, unknown_name
from met.diagnostic import Problem, error
from met.dynamics.spatial import HERE, Pose
from met.plan import Experiment
from met.plan.channel import OF_LINK

LINK = "link"
OWN = frozenset({"position", "orientation", LINK, "axis", "quaternion"})
"""Names of computed variables; a deck's name that equals one of them gets a word before it, as in an archive."""

TOLD = {name: {"units": unit, "long_name": doc, "frame": frame} for name, unit, doc, _, frame in OF_LINK}
"""Attributes of a link's position and orientation, as in an archive where these are recorded."""


def frames(
    path: Path, parts: Mapping[str, xarray.Dataset], links: Sequence[str], *, whole: bool = False
) -> dict[str, xarray.Dataset]:
    """Frames in the world of these links, by Dataset of an archive (none: of all); one without any of the links is left
    out. whole: every case must have its history. Raises Problem E328, E370, E385, E389."""
    out: dict[str, xarray.Dataset] = {}
    known: dict[str, None] = {}
    for name, data in parts.items():
        with experiment(path, data) as (file, group):
            own = next(planned for planned in file.plan().experiments if planned.name == group.name)
            names = [link.name for link in own.structure.links]
            known |= dict.fromkeys(names)
            chosen = [link for link in links if link in names] if links else names
            if chosen:
                if whole:
                    _all_recorded(data, group)
                out[name] = _frames(path, data, group, own, chosen)
    for link in links:
        if link not in known:
            raise unknown_name(list(parts.values()), link, "no link", known)
    return out


def _frames(
    path: Path, data: xarray.Dataset, group: ArchiveGroup, own: Experiment, links: Sequence[str]
) -> xarray.Dataset:
    """The frames of these links in the world, by case and instant: position (m) and orientation (w, x, y, z)."""
    q = _positions(data, own)
    instants = q[0] if q else _instants(data)
    dims, shape = instants.dims, instants.shape
    case_places = places(group, path, data, _cases(data, instants))
    by_case = (-1, *(1,) * (len(shape) - 1)) if RECORDED in dims else ()
    varied = {v.path: group.at(v.name, case_places).reshape(by_case) for v in group.role("coordinate")}
    rows = [joint_positions.values for joint_positions in q]
    values = parameters(own, varied)
    base = _base(data, own, instants, values)
    world = world_poses(own, values, rows, base)
    unknown = np.isnan(sum((*rows, *base.p), np.zeros(shape)))
    along = dims.index("time") if "time" in dims else None
    poses = [pose_variables(world[link], shape, along) for link in links]
    coordinates: dict[str, Any] = {}
    for name, array in instants.coords.items():
        if name in OWN:
            attributes = {**array.attrs, "path": path_of(str(name), array.attrs)}
            coordinates[f"coordinates.{name}"] = (array.dims, array.values, attributes)
        elif not _of_joints(array):
            coordinates[str(name)] = array.variable
    out = xarray.Dataset(
        {
            "position": ((*dims, LINK, "axis"), _stacked([pose.position for pose in poses], unknown), TOLD["position"]),
            "orientation": (
                (*dims, LINK, "quaternion"),
                _stacked([pose.orientation for pose in poses], unknown),
                TOLD["orientation"],
            ),
        },
        coords={**coordinates, LINK: list(links), "axis": list("xyz"), "quaternion": list("wxyz")},
        attrs=data.attrs,
    )
    out.encoding = {"source": str(path)}
    return out


def _stacked(links: Sequence[np.ndarray], unknown: np.ndarray) -> np.ndarray:
    """Vectors of links as one array, [..., link, component], not-a-number where a row is unknown."""
    out = np.stack(links, axis=-2)
    out[unknown] = np.nan
    return out


def _all_recorded(data: xarray.Dataset, group: ArchiveGroup) -> None:
    """Raise Problem E328 where a case has no history."""
    recorded = data[RECORDED].values if RECORDED in data.coords else np.empty(0)
    for case in data[CASE].values[~np.isin(data[CASE].values, recorded)] if CASE in data.coords else ():
        group.recorded_position(f"#{int(case)}")


def _positions(data: xarray.Dataset, own: Experiment) -> tuple[xarray.DataArray, ...]:
    """q of each moving joint, over the same dimensions, cases first; rad or m. Raises Problem E370."""
    units = {joint.name: "m" if joint.kind == "prismatic" else "rad" for joint in own.structure.moving}
    q_of_joint = {joint: _position(data, joint, unit) for joint, unit in units.items()}
    lacking = [joint for joint, q in q_of_joint.items() if q is None]
    of_base = [name for name in OF_FREE_BASE if own.structure.free and name not in data]
    if lacking or of_base:
        which = lacking_text(lacking, list(q_of_joint), of_base)
        message = f"the links of `{run_name(data)}` cannot be placed: {which} is not in this Dataset"
        recorded = {channel for recording in own.structure.record for channel in recording.channels}
        helps = lacking_help(free=bool(of_base))
        if recorded.issuperset(f"{joint}.{POSITION}" for joint in lacking) and RECORDED not in data.coords:
            helps = NO_HISTORIES
        raise Problem(error("E370", message, help=helps))
    alike: tuple[xarray.DataArray, ...] = xarray.broadcast(*(q for q in q_of_joint.values() if q is not None))
    return tuple(q.transpose(RECORDED, ..., missing_dims="ignore") for q in alike)


def _base(data: xarray.Dataset, own: Experiment, instants: xarray.DataArray, values: Mapping[str, Any]) -> Pose:
    """The pose of the base, by the instants' dimensions."""
    if own.structure.base is None:
        return HERE
    if own.structure.free:
        position, orientation = (data[name].transpose(*instants.dims, ...).values for name in OF_FREE_BASE)
        return free_pose(position.astype(np.float64), orientation.astype(np.float64))
    time = xarray.broadcast(instants["time"], instants)[0].transpose(*instants.dims)
    return prescribed_pose(own, values, time.values)


def _position(data: xarray.Dataset, joint: str, unit: str) -> xarray.DataArray | None:
    """q of a joint, as a signal of its own or as part of all joints' signal."""
    if f"{joint}.{POSITION}" in data:
        q = data[f"{joint}.{POSITION}"]
    elif POSITION in data:
        every = data[POSITION]
        dim = next((str(name) for name, array in every.coords.items() if _of_joints(array)), "")
        names = np.atleast_1d(every[dim].values).tolist() if dim else []
        if joint not in names:
            return None
        q = every.isel({dim: names.index(joint)}, drop=True) if dim in every.dims else every
    else:
        return None
    return q.astype(np.float64) / number(f"1 {unit}", POSITION, str(q.attrs.get("units", unit)))


def _of_joints(array: xarray.DataArray) -> bool:
    """True if a coordinate holds joints' names: a deck may vary `joint_1.servo.kp`, which holds numbers."""
    name = str(array.name)
    return (name == "joint" or name.startswith("joint_of_")) and array.dtype.kind not in "iuf"


def _instants(data: xarray.Dataset) -> xarray.DataArray:
    """Zeros over cases and time, for an arm without moving joints."""
    dims = [dim for dim in (RECORDED, "time") if dim in data.dims]
    return xarray.DataArray(np.zeros([data.sizes[dim] for dim in dims]), {dim: data[dim] for dim in dims}, dims)


def _cases(data: xarray.Dataset, q: xarray.DataArray) -> np.ndarray:
    """Positions in the case table of the cases of this q. Raises Problem E389."""
    for name in (RECORDED, CASE):
        if name in q.coords:
            return np.atleast_1d(np.asarray(q[name].values))
    if data.sizes.get(CASE) == 1:
        return np.asarray(data[CASE].values)
    raise Problem(error("E389", "it is not known of which case this q is: `recorded_case` is gone"))
