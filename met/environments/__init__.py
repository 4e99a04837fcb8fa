"""Environment models, one a file. To add one: write its file, add it to `ENVIRONMENTS`."""

from met.environments import attitude_hold, bushing, gravity, joint_damping, plume, spring, wrench
from met.environments.environment import Environment

ENVIRONMENTS: tuple[Environment, ...] = (
    attitude_hold.ENVIRONMENT, bushing.ENVIRONMENT, gravity.ENVIRONMENT, joint_damping.ENVIRONMENT, plume.ENVIRONMENT,
    spring.ENVIRONMENT, wrench.ENVIRONMENT,
)  # fmt: skip
