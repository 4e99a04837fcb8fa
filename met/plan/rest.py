"""Joints that must begin at rest, as their servos declare it (`Servo.at_rest`): tested of a plan, in every case."""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace

import numpy as np

from met import models
from met.plan import Experiment, ServoUse

Test = tuple[str, list[str], Callable[[np.ndarray], np.ndarray], str]
"""Path that is at fault, paths of the numbers to test, whether they hold (values [case, path] -> [case]), and how to
say it where they do not."""


def tests(experiment: Experiment) -> list[Test]:
    """One test a joint that its servo may want at rest."""
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
