"""The joints that a run cannot begin balanced."""

from __future__ import annotations

import numpy as np

from met.plan import Experiment
from met.program.unheld import Unheld, unheld
from met.run import inputs


def unheld_at_start(experiment: Experiment) -> tuple[Unheld, ...]:
    """The joints that are to begin balanced in the first case and whose servos cannot hold them, in the arm's order."""
    return unheld(experiment, inputs(experiment, np.array([0])))[0]
