"""An independent Panda: Pinocchio, built from the published tables by Denavit-Hartenberg, with its servos in numpy.

Nothing here comes from met, ic or a deck. Joint order is joint1 ... joint7; SI units.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.oracles.package import Package

pin = Package("pinocchio")

Array = np.ndarray

# Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca, IEEE RA-L 4(4), 2019, 4147-4154:
# mass (kg), centre of mass (m), inertia about it xx, yy, zz, xy, xz, yz (kg m^2)
# fmt: off
LINKS = (
    (4.970684, (0.003875, 0.002081, -0.047620), (0.703370, 0.706610, 0.009117, -0.000139, 0.006772, 0.019169)),
    (0.646926, (-0.003141, -0.028720, 0.003495), (0.007962, 0.028110, 0.025995, -0.003925, 0.010254, 0.000704)),
    (3.228604, (0.027518, 0.039252, -0.066502), (0.037242, 0.036155, 0.010830, -0.004761, -0.011396, -0.012805)),
    (3.587895, (-0.053170, 0.104419, 0.027454), (0.025853, 0.019552, 0.028323, 0.007796, -0.001332, 0.008641)),
    (1.225946, (-0.011953, 0.041065, -0.038437), (0.035549, 0.029474, 0.008627, -0.002117, -0.004037, 0.000229)),
    (1.666555, (0.060149, -0.014117, -0.010517), (0.001964, 0.004354, 0.005433, 0.000109, -0.001158, 0.000341)),
    (0.735522, (0.010517, -0.004252, 0.061597), (0.012516, 0.010027, 0.004815, -0.000428, -0.001196, -0.000741)),
)

# Franka Control Interface documentation, Craig's convention: a (m), alpha (quarter turns), d (m); flange 0.107 m on
CRAIG = (
    (0.0, 0, 0.333), (0.0, -1, 0.0), (0.0, 1, 0.316), (0.0825, 1, 0.0), (-0.0825, -1, 0.384),
    (0.0, 1, 0.0), (0.088, 1, 0.0)
)
# fmt: on
FLANGE = 0.107

READY = np.array([0.0, -np.pi / 4.0, 0.0, -3.0 * np.pi / 4.0, 0.0, np.pi / 2.0, np.pi / 4.0])

# What the model library of a real Panda answers for READY and no load, g = 9.81 m/s^2 (N m): dumped from it, in
# github.com/BarisYazici/franka-rs, crates/franka-rs/tests/data/model_reference_fer.json, sample 1, configuration 0.
FRANKA_GRAVITY_READY = np.array([0.0, -1.7355311, -0.6707509, 18.5228737, 0.7156273, 1.6715219, 0.0])


def panda(load: float = 0.0, load_radius: float = 0.0, rotors: Array | None = None) -> pin.Model:
    """The arm with a uniform sphere (kg, m) centred on its flange, and rotor inertia N^2 J_m (kg m^2)."""
    model = pin.Model()
    parent = 0
    for i, ((a, alpha, d), (mass, com, moments)) in enumerate(zip(CRAIG, LINKS, strict=True), start=1):
        turn = pin.utils.rotate("x", alpha * np.pi / 2.0)
        place = pin.SE3(turn, np.array([a, 0.0, 0.0])) * pin.SE3(np.eye(3), np.array([0.0, 0.0, d]))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{i}")
        xx, yy, zz, xy, xz, yz = moments
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.appendBodyToJoint(parent, pin.Inertia(mass, np.array(com), inertia), pin.SE3.Identity())
    if load > 0.0:
        ball = pin.Inertia(load, np.zeros(3), 0.4 * load * load_radius**2 * np.eye(3))
        model.appendBodyToJoint(parent, ball, pin.SE3(np.eye(3), np.array([0.0, 0.0, FLANGE])))
    if rotors is not None:
        model.armature = rotors
    model.gravity.linear = np.array([0.0, 0.0, -9.81])
    return model


def follow(
    model: pin.Model,
    q: Array,
    course: Callable[[float], tuple[Array, Array]],
    *,
    ratio: float,
    kt: Array,
    resistance: Array,
    tau_max: Array,
    kp: Array,
    ki: Array,
    k_position: float,
    hz: float,
    steps: int,
) -> tuple[Array, Array]:
    """(q, tau) [step, joint] of the frictionless arm under PI servos at `hz`, by Heun's rule at the same rate.

    course(t) -> (position asked, its rate). The voltages stay below their limit, which is not modelled.
    """
    data, h = model.createData(), 1.0 / hz
    qd, integral = np.zeros(7), np.zeros(7)
    positions, torques = [], []

    def slope(q: Array, qd: Array, voltage: Array) -> tuple[Array, Array]:
        tau = ratio * np.clip(kt * (voltage - kt * ratio * qd) / resistance, -tau_max, tau_max)
        return pin.aba(model, data, q, qd, tau), tau

    for k in range(steps + 1):
        asked, rate = course(k / hz)
        error = ratio * (rate + k_position * (asked - q) - qd)
        voltage = kp * error + ki * integral
        integral = integral + h * error
        first, tau = slope(q, qd, voltage)
        positions.append(q)
        torques.append(tau)
        second, _ = slope(q + h * qd, qd + h * first, voltage)
        q, qd = q + h * qd + h * h / 2.0 * first, qd + h / 2.0 * (first + second)
    return np.array(positions), np.array(torques)
