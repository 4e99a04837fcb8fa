"""Joints that must begin at rest, as their servos declare it (`Servo.at_rest`): tested of a plan, in every case."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from met import models
from met.plan import Experiment, ServoUse

Test = tuple[str, list[str], Callable[[np.ndarray], np.ndarray], str]
"""Path at fault, paths of the numbers to test, the test (values [case, path] -> [case]), and the message where it
fails."""


def tests(experiment: Experiment) -> list[Test]:
    """One test for each joint that its servo may require at rest."""
    return [
        _test(experiment, use)
        for use in experiment.structure.servos
        if models.find("servo", use.model, use.place).at_rest is not None
    ]


def _test(experiment: Experiment, use: ServoUse) -> Test:
    servo, rate = models.find("servo", use.model, use.place), f"initial.{use.joint}.qd"
    head = f"{use.joint}.servo."
    numbers = {
        path.removeprefix(head): path
        for path, quantity in experiment.parameters.items()
        if path.startswith(head) and not isinstance(quantity.value, str | tuple)
    }

    def holds(values: np.ndarray) -> np.ndarray:
        p = SimpleNamespace(**{name: values[:, i] for i, name in enumerate(numbers, 1)})
        return np.asarray(np.logical_not(servo.at_rest(p)) | (values[:, 0] == 0.0))

    message = f"a {use.model} joint begins at rest"
    return rate, [rate, *numbers.values()], holds, message
