"""Integrators, one a file. To add one: write its file, add it to `INTEGRATORS`."""

from met.integrators import midpoint, modified_euler, rk4, semi_implicit_euler
from met.integrators.integrator import Integrator

INTEGRATORS: tuple[Integrator, ...] = (
    modified_euler.INTEGRATOR,
    midpoint.INTEGRATOR,
    semi_implicit_euler.INTEGRATOR,
    rk4.INTEGRATOR,
)

DEFAULT_INTEGRATOR = modified_euler.INTEGRATOR
"""The integrator of a run that names none."""
