"""Environment models, one a file. To add one: write its file, add it to `ENVIRONMENTS`."""

from met.environments import (
    attitude_hold,
    brake,
    bushing,
    contact,
    dead_sensor,
    free_swinging,
    gravity,
    gravity_gradient,
    joint_damping,
    joint_stop,
    plume,
    runaway,
    spring,
    wrench,
    wrench_table,
)
from met.environments.environment import Environment

ENVIRONMENTS: tuple[Environment, ...] = (
    attitude_hold.ENVIRONMENT,
    brake.ENVIRONMENT,
    bushing.ENVIRONMENT,
    contact.ENVIRONMENT,
    dead_sensor.ENVIRONMENT,
    free_swinging.ENVIRONMENT,
    gravity.ENVIRONMENT,
    gravity_gradient.ENVIRONMENT,
    joint_damping.ENVIRONMENT,
    joint_stop.ENVIRONMENT,
    plume.ENVIRONMENT,
    runaway.ENVIRONMENT,
    spring.ENVIRONMENT,
    wrench.ENVIRONMENT,
    wrench_table.ENVIRONMENT,
)
