"""Environment models, one a file. To add one: write its file, add it to `ENVIRONMENTS`."""

from met.environments import gravity, joint_damping, plume, wrench
from met.environments.environment import Environment

ENVIRONMENTS: tuple[Environment, ...] = (
    gravity.ENVIRONMENT, joint_damping.ENVIRONMENT, plume.ENVIRONMENT, wrench.ENVIRONMENT,
)  # fmt: skip
