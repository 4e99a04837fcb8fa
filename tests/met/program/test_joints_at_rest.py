"""Which joints of a chain at rest break away, where passes that change all modes at once go round in a circle."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

from met import run as engine
from met.frozen import frozen
from met.program import friction
from tests.ic.small_decks import experiment

pytestmark = pytest.mark.slow

g = 9.81


@frozen
class Chain:
    """A chain of rods in a vertical plane, each with its own friction at its joint: SI, angles from joint to joint."""

    q: np.ndarray
    length: np.ndarray
    mass: np.ndarray
    dry: np.ndarray

    def jacobian(self, k: int) -> np.ndarray:
        """Of the centre of mass of rod k, in the plane."""
        angle, found = self.q.cumsum(), np.zeros((2, len(self.q)))
        for i in range(k + 1):
            for rod in range(i, k + 1):
                reach = self.length[rod] * (0.5 if rod == k else 1.0)
                found[:, i] += reach * np.array([-np.sin(angle[rod]), np.cos(angle[rod])])
        return found

    @property
    def inertia(self) -> np.ndarray:
        n, found = len(self.q), np.zeros((len(self.q), len(self.q)))
        for k in range(n):
            turned = (np.arange(n) <= k).astype(float)
            found += self.mass[k] * (self.jacobian(k).T @ self.jacobian(k) + 0.01 * np.outer(turned, turned))
        return found

    @property
    def load(self) -> np.ndarray:
        """Torque of gravity on each joint."""
        return sum((-g * self.mass[k] * self.jacobian(k)[1] for k in range(len(self.q))), np.zeros(len(self.q)))

    def moved(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations in these modes, and what friction must hold."""
        slides, M, qdd = s != 0.0, self.inertia, np.zeros(len(self.q))
        if slides.any():
            qdd[slides] = np.linalg.solve(M[np.ix_(slides, slides)], (self.load - s * self.dry)[slides])
        return qdd, self.load - M @ qdd

    def holds(self, s: np.ndarray) -> bool:
        """Whether these modes are true: what sticks is held, and what slides goes the way it is rubbed against."""
        qdd, need = self.moved(s)
        return bool(np.where(s == 0.0, np.abs(need) <= self.dry, s * qdd >= 0.0).all())

    def goes_round(self) -> bool:
        """Whether passes that change all at once do not settle."""
        s = np.zeros(len(self.q))
        for _ in range(friction.decision_passes(len(s))):
            qdd, need = self.moved(s)
            new = np.array([friction.decide(*of) for of in zip(s, s == s, need, self.dry, qdd, strict=True)])
            if (new == s).all():
                return False
            s = new
        return True

    def deck(self) -> str:
        n = range(len(self.q))
        length, mass, dry = self.length.tolist(), self.mass.tolist(), self.dry.tolist()
        parts = [
            f"link rod{k} {{ mass = {mass[k]!r} kg; com = [{length[k] / 2!r}, 0, 0] m; "
            f"inertia = [1, 1, {0.01 * mass[k]!r}] kg*m^2; }} "
            f"joint j{k} revolute {{ parent = {f'rod{k - 1}' if k else 'base'}; child = rod{k}; axis = z; "
            f"at = [{length[k - 1] if k else 0.0!r}, 0, 0] m; }}"
            for k in n
        ]
        servos = "".join(f"j{k} = rubs {{ friction = {dry[k]!r} N*m; }};" for k in n)
        return (
            f"arm chain {{ {' '.join(parts)} }} servo rubs {{ model = passive; friction = 1 N*m; }} "
            f"run let_go {{ arm = chain; servos {{ {servos} }} environment {{ gravity = [0, -{g}, 0] m/s^2; }} "
            f"initial {{ q = [{', '.join(map(repr, self.q.tolist()))}] rad; }} "
            "rates { dynamics = 1 kHz; record = 1 kHz; } duration = 0.2 s; record = [q, qd, qdd]; }"
        )


def chain(rng: np.random.Generator, joints: int) -> Chain:
    made = Chain(rng.uniform(-3, 3, joints), rng.uniform(0.2, 1, joints), rng.uniform(0.5, 3, joints), np.zeros(joints))
    return Chain(made.q, made.length, made.mass, np.abs(made.load) * rng.uniform(0.2, 1.5, joints))


def that_goes_round(joints: int, count: int) -> list[Chain]:
    rng, found = np.random.default_rng(joints), []
    while len(found) < count:
        made = chain(rng, joints)
        found += [made] * made.goes_round()
    return found


@pytest.mark.release
@pytest.mark.parametrize(("joints", "count"), [(3, 3), (5, 3), (8, 3)])
def test_joints_that_went_round_in_a_circle_find_the_one_true_answer(joints: int, count: int, tmp_path: Path) -> None:
    for made in that_goes_round(joints, count):
        run = engine.run(experiment(tmp_path, made.deck()))
        qdd, (undecided,) = run.signals["qdd"][0, 0], run.events["undecided"]
        assert undecided == 0
        s = np.sign(qdd)
        assert made.holds(s) and np.abs(qdd - made.moved(s)[0]).max() < 1e-9 * np.abs(qdd).max()
        if joints < 8:  # no other modes are true
            assert sum(made.holds(np.array(each)) for each in itertools.product((-1.0, 0.0, 1.0), repeat=joints)) == 1
        assert np.abs(run.signals["q"][0, -1] - made.q).max() > 1e-3, "it moves"
