"""Command profiles, one a file. To add one: write its file, add it to `PROFILES`."""

from met.commands import chirp, constant, pulse, ramp, sine, step, table, trajectory, trapezoid
from met.commands.profile import Profile

PROFILES: tuple[Profile, ...] = (
    chirp.PROFILE,
    constant.PROFILE,
    pulse.PROFILE,
    ramp.PROFILE,
    sine.PROFILE,
    step.PROFILE,
    table.PROFILE,
    trajectory.PROFILE,
    trapezoid.PROFILE,
)
