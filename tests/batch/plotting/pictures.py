"""Archives to draw, and what is looked at in a figure."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.collections import PolyCollection, QuadMesh

import batch
from batch.archive.read import ArchiveFile
from tests.batch import plans


def archive(cases: int, histories: str = "default") -> ArchiveFile:
    """Of the engine that answers at once: one case, or a sweep of two parameters that go in step."""
    experiment = plans.gains(cases) if cases > 1 else plans.nominal()
    batch.run(plans.plan(experiment), output="a.h5", histories=histories)
    return ArchiveFile("a.h5")


def shown(figure: Any) -> list[Any]:
    """The panels that are seen."""
    return [ax for ax in figure.axes if ax.get_visible()]


def said(figure: Any) -> str:
    """The line under the title."""
    return " ".join(text.get_text() for text in figure.texts if text.get_text() != figure.get_suptitle())


def mesh(ax: Any) -> np.ndarray:
    """The values of a map's cells, from the lowest row; not a number where it has none."""
    [found] = [each for each in ax.collections if isinstance(each, QuadMesh)]
    return np.asarray(np.ma.filled(found.get_array(), np.nan))


def cells(ax: Any, *, hatch: str | None = None, face: str = "") -> int:
    """How many cells are marked so: a mark goes over neighbours in a row."""
    from matplotlib.colors import to_hex

    [drawn] = [each for each in ax.collections if isinstance(each, QuadMesh)]
    edges = drawn.get_coordinates()[0, :, 0]
    return sum(
        int(np.diff(np.searchsorted(edges, path.get_extents().intervalx * (1 + 1e-12)))[0])
        for each in ax.collections
        if isinstance(each, PolyCollection)
        and not isinstance(each, QuadMesh)
        and each.get_hatch() == hatch
        and (not face or to_hex(each.get_facecolor()[0]) == face)
        for path in each.get_paths()
    )
