"""Cases on motor beds, one after another: each in a process of its own, its records made into a shard at its end.

A case whose records are there already, because whoever drove it was killed, is not driven again: what was recorded is
what came of it.
"""

from __future__ import annotations

import contextlib
import json
import subprocess
import sys
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch import shard
from batch.beds.made import Made, made
from batch.executors import Outcome
from batch.folder import Folder
from batch.tasks import Done, Section, Task
from hw import records
from hw.case import Asked
from met import plan_file
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Plan
from met.run import FAILED


@frozen
class Ports:
    """Where the beds are. by_joint: port by joint;  transcripts: a folder for what goes over the lines, or None
    rest: s before each case but the first, for the motors to cool"""

    by_joint: Mapping[str, str]
    baud: int
    lock_step: bool = False
    rest: float = 0.0
    transcripts: Path | None = None


class OnBeds:
    """The executor. say: takes what is told of a bed, as it comes."""

    workers = 1

    def __init__(self, ports: Ports, say: Callable[[str], None] = lambda _: None) -> None:
        self._ports, self._say = ports, say
        self._waiting: deque[Task] = deque()
        self._driven = 0
        self.about = ", ".join(dict.fromkeys(ports.by_joint.values()))
        self.exchanges: dict[tuple[int, int], tuple[np.ndarray, ...]] = {}
        """Records by section's experiment and row, of each bed, of the cases that were driven or taken up."""
        self.joints = tuple(ports.by_joint)
        self.lock_step = ports.lock_step
        self.tick_hz = float("nan")

    @property
    def under_way(self) -> int:
        return 0

    def open(self, folder: Folder, sections: Mapping[int, Section], tell: Callable[[], None]) -> None:
        self._folder, self._sections, self._tell = folder, sections, tell
        folder.beds.mkdir(exist_ok=True)

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def wait(self) -> list[Outcome]:
        if not self._waiting:
            return []
        task = self._waiting.popleft()
        section = self._sections[task.section]
        found = [self._case(section, int(row)) for row in section.rows[task.first : task.last]]
        made = [each for each, _ in found]
        history = np.stack([each.rows for each in made]) if section.recorded else None
        if history is not None and section.single:
            history = history.astype(np.float32)
        fates = {place: (FAILED, why) for place, (_, why) in enumerate(found) if why}
        computed = shard.Shard(
            section.key(task.first, task.last), np.stack([each.outputs for each in made]), history,
            sum(each.seconds for each in made), fates,
        )  # fmt: skip
        try:
            shard.write(self._folder.shards / task.name, computed)
        except OSError as reason:
            return [Outcome(task, "broken", why=shard.cannot_keep(self._folder.path, reason))]
        return [Outcome(task, "done", Done(computed.seconds, computed.failed))]

    def close(self) -> None:
        self._waiting.clear()

    def _case(self, section: Section, row: int) -> tuple[Made, str]:
        """What came of a case, and why it ended early, "" where it did not."""
        path = self._folder.beds / f"{section.experiment}-{row}.records"
        told = path.with_suffix(".ended")
        if not path.exists():
            self._drive(section, row, path, told)
        try:
            found = made(path, section.prepared, row)
        except (records.Unsound, OSError) as reason:
            raise Problem(error("E413", f"the records of case #{row} {reason}", help=f"remove {path}")) from None
        self.exchanges[section.experiment, row] = found.exchanges
        if found.whole:
            return found, ""
        why = "the host was gone"
        with contextlib.suppress(OSError, ValueError, KeyError):
            why = str(json.loads(told.read_text(encoding="utf-8"))["why"]) or why
        ticks = section.prepared.experiment.structure.schedule
        at = float(found.outputs[2]) / ticks.base_hz
        return found, f"t = {at:g} s: {why}"

    def _drive(self, section: Section, row: int, path: Path, told: Path) -> None:
        """Raises Problem, and KeyboardInterrupt when the case's process has stopped the beds."""
        ports = self._ports
        experiment = section.prepared.experiment
        plan = plan_file.dumps(Plan("", (replace(experiment, notes=()),)))
        transcripts = {} if ports.transcripts is None else {
            joint: str(ports.transcripts / f"{experiment.name}.{row}.{joint}.transcript") for joint in ports.by_joint
        }  # fmt: skip
        asked = Asked(
            plan=plan, row=row, ports=dict(ports.by_joint), records=str(path), lock_step=ports.lock_step,
            baud=ports.baud, rest=ports.rest if self.exchanges else 0.0, head={"key": section.key()},
            transcripts=transcripts,
        )  # fmt: skip
        process = subprocess.Popen(
            [sys.executable, "-m", "hw.case"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        assert process.stdin is not None and process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            process.stdin.write(asked.text())
            process.stdin.close()
        ended: dict[str, Any] | None = None
        interrupted = False
        try:
            while True:
                try:
                    for line in process.stdout:
                        ended = self._heard(json.loads(line)) or ended
                    break
                except KeyboardInterrupt:  # which its process hears too, and stops the beds
                    interrupted = True
        finally:
            process.stdout.close()
            process.wait()
        if ended is not None:
            told.write_text(json.dumps(ended), encoding="utf-8")
        if interrupted:
            raise KeyboardInterrupt
        if not path.exists():
            raise Problem(error("E417", f"the process that drives the beds ended with {process.returncode}",
                                help="the beds stop themselves; run it again"))  # fmt: skip

    def _heard(self, data: dict[str, Any]) -> dict[str, Any] | None:
        """Takes a line of the case's process; how it ended, when it says so. Raises Problem for what is wrong."""
        if "wrong" in data:
            found = data["wrong"]["diagnostics"]
            raise Problem([error(each["code"], each["message"], help=each["help"]) for each in found])
        if "said" in data:
            self._say(" ".join([data["said"], *(f"({each})" for each in data.get("help", ()))]))
        if "about" in data:
            about = data["about"]
            self.tick_hz = float(about["tick_hz"])
            self._say(f"{data['bed']}: bed `{about['name']}`, firmware {about['firmware']}")
        return data.get("ended")
