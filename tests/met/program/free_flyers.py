"""Decks of arms on bases that move, for tests that change them."""

from __future__ import annotations

import numpy as np

ARM = """\
arm flyer {
    link base  { mass = 40 kg; inertia = [5, 7, 9, 0.3, -0.4, 0.5] kg*m^2; com = [0.1, 0.05, -0.1] m; }
    link upper { mass = 10 kg; shape = rod(length = 1 m, along = x); }
    link lower { mass = 5 kg;  shape = box(size = [1, 0.2, 0.1] m, along = x); }
    joint shoulder revolute { parent = base;  child = upper; axis = z; at = [0.5, 0, 0] m; rpy = [20, 30, 0] deg; }
    joint elbow    revolute { parent = upper; child = lower; axis = y; at = [1, 0, 0] m; }
}
"""

RUN = """\
run tumbling {
    arm      = flyer;
    base     = free;
    initial {
        shoulder.q    = 20 deg;
        elbow.q       = 40 deg;
        shoulder.qd   = 0.5 rad/s;
        elbow.qd      = -1 rad/s;
        base.position = [1, 2, 3] m;
        base.rpy      = [10, 20, 30] deg;
        base.velocity = [0.1, -0.2, 0.3] m/s;
        base.rate     = [40, 20, -60] deg/s;
    }
    environment {}
    rates    { dynamics = 100 Hz; record = 10 Hz; }
    integrator = modified_euler;
    duration = 2 s;
    record   = [q, qd, qdd, tau, links.base.position, links.base.orientation, links.base.velocity, links.base.rate,
                energy, momentum, J_eff, b];
}
"""


def matrix(q: np.ndarray) -> np.ndarray:
    """The rotation matrix of a unit quaternion (w, x, y, z)."""
    w, v = q[0], q[1:]
    K = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    return np.eye(3) + 2.0 * w * K + 2.0 * K @ K
