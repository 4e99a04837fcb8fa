"""Environment models, one a file. To add one: write its file, add it to `ENVIRONMENTS`."""

from met.environments import (
    attitude_hold,
    brake,
    bushing,
    gravity,
    gravity_gradient,
    joint_damping,
    joint_stop,
    plume,
    spring,
    wrench,
    wrench_table,
)
from met.environments.environment import Environment

ENVIRONMENTS: tuple[Environment, ...] = (
    attitude_hold.ENVIRONMENT,
    brake.ENVIRONMENT,
    bushing.ENVIRONMENT,
    gravity.ENVIRONMENT,
    gravity_gradient.ENVIRONMENT,
    joint_damping.ENVIRONMENT,
    joint_stop.ENVIRONMENT,
    plume.ENVIRONMENT,
    spring.ENVIRONMENT,
    wrench.ENVIRONMENT,
    wrench_table.ENVIRONMENT,
)
