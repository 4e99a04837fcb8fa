"""Plan -> program: what an experiment's models compute, phase by phase, and when."""

from met.program.build import build
from met.program.system import System

__all__ = ["System", "build"]
