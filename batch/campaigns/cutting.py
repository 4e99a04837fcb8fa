"""How large the next task of a section is: a second or two of work, so that starting it costs nothing and losing it
little, longer where very many workers ask for tasks; smaller towards the end, so that nobody waits for the last one. It
decides nothing but speed."""

from __future__ import annotations

from batch.campaigns.tasks import GRANULE, CampaignSection

WORK_SECONDS = 1.5
"""Time that a task is to take on the worker that runs it, s, where workers are few."""

TASKS_A_SECOND = 100.0
"""Tasks that end on all workers together, at most: a scheduler hands out several hundred, and has more to do."""

FIRST_SECONDS = 0.2
"""Time that the first tasks are to take, s, by a guess that may be off by a factor of ten."""

GUESS_NS = 40.0
"""Time of one joint's step, ns, assumed before anything was measured."""


class Cutter:
    """Learns from the tasks that are done how long a case takes."""

    def __init__(self, section: CampaignSection) -> None:
        structure = section.prepared.experiment.structure
        steps = structure.schedule.ticks // min([structure.schedule.dynamics, *(s.divisor for s in structure.servos)])
        self._most = section.most
        self._guess = 1e-9 * GUESS_NS * steps * max(1, len(structure.joints))
        self._seconds, self._cases = 0.0, 0.0

    def learn(self, cases: int, seconds: float) -> None:
        """Note that a worker took so long for so many cases."""
        if cases >= GRANULE:  # fewer take as long as a whole block
            self._seconds, self._cases = 0.5 * self._seconds + seconds, 0.5 * self._cases + cases

    def size(self, left: int, workers: int) -> int:
        """Cases of the next task, where so many are left for so many workers."""
        if self._cases:
            wanted = max(WORK_SECONDS, workers / TASKS_A_SECOND) * self._cases / max(self._seconds, 1e-9)
        else:
            wanted = FIRST_SECONDS / self._guess
        wanted = min(wanted, -(-left // (2 * workers)) if workers > 1 else left)
        cases = max(GRANULE, int(wanted) // GRANULE * GRANULE)
        return min(cases, self._most, left)
