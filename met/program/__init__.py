"""Programs from plans: the computations of an experiment's models, phase by phase, and their order."""

from met.program.build import build
from met.program.system import System

__all__ = ["System", "build"]
