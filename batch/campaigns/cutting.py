"""The size of a section's next task: a second or two of work, so that its start costs little and its loss too; more
if very many workers ask for tasks, and less towards the end, so that nobody waits for the last one. It affects only
speed."""

from __future__ import annotations

from batch.campaigns.tasks import GRANULE, CampaignSection

WORK_SECONDS = 1.5
"""Intended duration of a task on its worker, s, where workers are few."""

TASKS_A_SECOND = 100.0
"""Largest number of tasks that end in a second on all workers together: a scheduler handles several hundred, and has
other work."""

FIRST_SECONDS = 0.2
"""Intended duration of the first tasks, s, by a guess that may be off by a factor of ten."""

GUESS_NS = 40.0
"""Time of one joint's step, ns, assumed before any measurement."""


class Cutter:
    """Estimates the duration of a case from finished tasks."""

    def __init__(self, section: CampaignSection) -> None:
        structure = section.prepared.experiment.structure
        steps = structure.schedule.ticks // min([structure.schedule.dynamics, *(s.divisor for s in structure.servos)])
        self._most = section.most
        self._guess = 1e-9 * GUESS_NS * steps * max(1, len(structure.joints))
        self._seconds, self._cases = 0.0, 0.0

    def learn(self, cases: int, seconds: float) -> None:
        """Note the time that a worker took for these cases."""
        if cases >= GRANULE:  # fewer take as long as a whole block
            self._seconds, self._cases = 0.5 * self._seconds + seconds, 0.5 * self._cases + cases

    def size(self, left: int, workers: int) -> int:
        """The number of cases of the next task, for so many cases left and so many workers."""
        if self._cases:
            wanted = max(WORK_SECONDS, workers / TASKS_A_SECOND) * self._cases / max(self._seconds, 1e-9)
        else:
            wanted = FIRST_SECONDS / self._guess
        wanted = min(wanted, -(-left // (2 * workers)) if workers > 1 else left)
        cases = max(GRANULE, int(wanted) // GRANULE * GRANULE)
        return min(cases, self._most, left)
