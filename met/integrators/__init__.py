"""Integrators, one a file. To add one: write its file, add it to `INTEGRATORS`."""

from met.integrators import modified_euler
from met.integrators.integrator import Integrator

INTEGRATORS: tuple[Integrator, ...] = (modified_euler.INTEGRATOR,)
