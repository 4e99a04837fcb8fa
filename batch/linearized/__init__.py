"""Linear answers as data: in xarray, as systems of python-control, in files, and as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from batch.linearized import data
from met.analysis.linear.answers import Linearized
from met.frozen import frozen
from met.outputs import path_of


@frozen
class LinearAnswer:
    """The answer of `batch.linear`, as found (`found.poles`, `.natural`, `.loops`) and as data."""

    found: Linearized

    @property
    def data(self) -> Any:
        """An xarray.Dataset: A, B, C, D of a period, plant_A and plant_B in continuous time, poles with shares."""
        return data.to_xarray(self.found)

    def state_space(self) -> Any:
        """A `control.StateSpace` in discrete time. Raises Problem E451 where python-control is missing."""
        return data.state_space(self.found)

    def write(self, output: Path | str) -> None:
        """Writes A, B, C, D with names into a new file: .npz, .h5 or .csv. Raises Problem E305, E326."""
        data.check(path_of(output))
        data.write(self.found, Path(output))

    def draw(self, output: Path | str) -> None:
        """Draws opened loops (Bode, Nichols) and steps: .png, .svg or .pdf. Raises Problem E450, E305, E326."""
        from batch.linearized import picture
        from batch.plotting import output as places

        places.check(path_of(output))
        picture.draw(self.found, Path(output))
