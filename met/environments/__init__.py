"""Environment models, one a file. To add one: write its file, add it to `ENVIRONMENTS`."""

from met.environments import attitude_hold, gravity, joint_damping, wrench
from met.environments.environment import Environment

ENVIRONMENTS: tuple[Environment, ...] = (
    attitude_hold.ENVIRONMENT,
    gravity.ENVIRONMENT,
    joint_damping.ENVIRONMENT,
    wrench.ENVIRONMENT,
)
