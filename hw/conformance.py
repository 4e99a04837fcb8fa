"""The old name of `met_conformance`, the tests that every bed must pass."""

import warnings

from met_conformance import Conformance, FreeRunning, LockStep, Simulated, refused

__all__ = ["Conformance", "FreeRunning", "LockStep", "Simulated", "refused"]

WARNING = "`hw.conformance` is now `met_conformance`; the old name goes with MET 0.2"
warnings.warn(WARNING, DeprecationWarning, stacklevel=2)
