"""Division of the unit cube into boxes, as in DIRECT: the best boxes of each size are cut into three.

After Jones, Perttunen and Stuckman, *Lipschitzian Optimization Without the Lipschitz Constant* (JOTA 79(1), 1993), with
two changes. Boxes of every size are cut, the best of each (Baker et al., *Aggressive DIRECT*, HPC 2000), rather than
those on a convex hull of values: so values are only compared, and a batch can have any size. And a box is cut along one
of its longest edges, the one that was cut least often (Jones, *DIRECT*, Encyclopedia of Optimization, 2001).
"""

from __future__ import annotations

import math

import numpy as np

FINEST = 6
"""Largest number of times that an edge is cut: detail below 3^-6 of the cube's edge is left to polishing."""


class BoxDivision:
    """Boxes that fill the unit cube, each with the value of its centre. The first is the cube itself."""

    def __init__(self, dimension: int) -> None:
        self._dimension = dimension
        self._centres: list[np.ndarray] = []
        self._cuts: list[np.ndarray] = []
        self._values: list[float] = []
        self._of_size: dict[int, list[int]] = {}
        """The boxes by the number of times they were cut."""
        self._cut_along = np.zeros(dimension, np.int64)
        self._batch: list[tuple[np.ndarray, np.ndarray]] = []

    def ask(self, count: int) -> np.ndarray:
        """Centres of new boxes, [centre, dimension]: at most `count`, two for each box that is cut."""
        self._batch = []
        if not self._centres:
            self._batch = [(np.full(self._dimension, 0.5), np.zeros(self._dimension, np.int64))][:count]
        cutting = bool(self._centres)
        while cutting and len(self._batch) + 2 <= count:
            cutting = self._cut_round(count)
        return np.array([centre for centre, _ in self._batch]).reshape(-1, self._dimension)

    def _cut_round(self, count: int) -> bool:
        """Cut, for each size, the best boxes, as many as the square root of their number; False where there is nothing
        to cut."""
        before = len(self._batch)
        for size in sorted(self._of_size):
            if size >= FINEST * self._dimension:
                continue
            boxes = self._of_size[size]
            boxes.sort(key=lambda box: (self._values[box], box))
            number = min(math.isqrt(max(len(boxes) - 1, 0)) + 1, (count - len(self._batch)) // 2, len(boxes))
            best, self._of_size[size] = boxes[:number], boxes[number:]
            for box in best:
                self._cut(box)
        return len(self._batch) > before

    def _cut(self, box: int) -> None:
        cuts = self._cuts[box].copy()
        longest = np.flatnonzero(cuts == cuts.min())
        along = int(longest[np.argmin(self._cut_along[longest])])
        self._cut_along[along] += 1
        cuts[along] += 1
        third = 1.0 / 3 ** int(cuts[along])
        for side in (-third, third):
            centre = self._centres[box].copy()
            centre[along] += side
            self._batch.append((centre, cuts))
        self._cuts[box] = cuts
        self._of_size.setdefault(int(cuts.sum()), []).append(box)

    def tell(self, values: np.ndarray) -> None:
        """Take the values of the centres that were asked last, [centre]."""
        for (centre, cuts), value in zip(self._batch, values, strict=True):
            self._of_size.setdefault(int(cuts.sum()), []).append(len(self._centres))
            self._centres.append(centre)
            self._cuts.append(cuts)
            self._values.append(float(value))
