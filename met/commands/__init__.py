"""Command profiles, one a file. To add one: write its file, add it to `PROFILES`."""

from met.commands import constant, ramp, sine, step, table
from met.commands.profile import Profile

PROFILES: tuple[Profile, ...] = (constant.PROFILE, ramp.PROFILE, sine.PROFILE, step.PROFILE, table.PROFILE)
