"""Cases on motor beds, one after another: each in a process of its own, its records made into a shard at its end.

A case whose records exist already, because its process was killed, is not driven again: its result is computed from the
records. Records of a bed that was never armed do not count.
"""

from __future__ import annotations

import contextlib
import json
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch.beds.case_result import CampaignRecords, CaseResult, case_result
from batch.campaigns import tasks
from batch.campaigns.drive import Outcome
from batch.campaigns.folder import Folder
from batch.campaigns.resuming import changed_since
from batch.campaigns.tasks import CampaignSection, Done, Task
from hw.drivers import bench_at, same_bed
from hw.driving.case import CaseRequest, pace_of
from hw.driving.process import talk
from hw.recording import records
from met import run as engine
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.host.files import new_file, read_json
from met.plan import Plan
from met.plan import file as plan_file
from met.run import FAILED

ANOTHER, FULL = "E407", "E413"
"""Codes of errors that say nothing about a bed that was armed: another transcript's, a full disk. Any other error ends
the case."""


@frozen
class Ports:
    """The ports of a campaign, and the way in which its cases are driven.

    by_joint     port by joint
    transcripts  a folder for what goes over the lines; None: none is kept
    rest         s before each case but the first, for the motors to cool
    clear        True: faults are cleared before each case
    """

    by_joint: Mapping[str, str]
    baud: int
    lock_step: bool = False
    rest: float = 0.0
    transcripts: Path | None = None
    clear: bool = False


@frozen
class Driving:
    """The case that is being driven. exchange_hz: exchanges a second with all its beds; seconds: length of the case"""

    records: Path
    exchange_hz: float
    seconds: float

    @property
    def done(self) -> float:
        """Seconds of the case whose records are on the disk."""
        try:
            return min(self.records.stat().st_size / records.SIZE / self.exchange_hz, self.seconds)
        except OSError:
            return 0.0


class OnBeds:
    """The executor that drives cases on beds, one after another. say: takes lines about the beds, as they come"""

    workers = 1

    def __init__(self, ports: Ports, say: Callable[[str], None] = lambda _: None) -> None:
        self.ports, self._say = ports, say
        self._waiting: deque[Task] = deque()
        self._greeted_beds: dict[str, str] = {}
        self.about = ", ".join(dict.fromkeys(ports.by_joint.values()))
        self.known = CampaignRecords(ports.by_joint)
        self.driving: Driving | None = None
        self.under_way = 0
        self.benches = {joint: bench_at(port) for joint, port in ports.by_joint.items()}

    def open(self, folder: Folder, sections: Mapping[int, CampaignSection], tell: Callable[[], None]) -> None:
        """Open the campaign's folder for records. Raises Problem E353 where cases in it were driven on other beds."""
        self._folder, self._sections, self._tell = folder, sections, tell
        folder.beds.mkdir(exist_ok=True)
        for path in folder.beds.glob("*.records"):
            with contextlib.suppress(records.UnsoundRecords, OSError):
                head = records.read(path).head
                ports, benches = head.get("ports", {}), head.get("benches", {})
                if not isinstance(ports, dict) or not all(isinstance(port, str) for port in ports.values()):
                    raise records.UnsoundRecords("has a head that is damaged")
                self.check(ports, benches, f"{folder.path} holds cases of this campaign")

    def know_all(self) -> None:
        """Add the records of cases that an earlier run of the campaign has driven."""
        self.known.add_all(self._folder.beds)

    def submit(self, task: Task) -> None:
        self._waiting.append(task)

    def wait(self) -> list[Outcome]:
        """Drive the cases of the next task on the motor beds, one after another, and keep their results as a shard (the
        file of a task's results). Nothing is done where no task waits."""
        if not self._waiting:
            return []
        task = self._waiting.popleft()
        section = self._sections[task.section]
        endings = []
        for self.under_way, row in enumerate(section.rows[task.first : task.last]):
            endings.append(self._case(section, int(row)))
        self.under_way = 0
        results = [result for result, _ in endings]
        history = np.stack([result.rows for result in results]) if section.recorded else None
        if history is not None and section.single:
            history = history.astype(np.float32)
        fates = {place: (FAILED, why) for place, (_, why) in enumerate(endings) if why}
        computed = tasks.Shard(
            section.key(task.first, task.last),
            engine.with_linear(section.prepared, np.stack([result.outputs for result in results])),
            history,
            sum(result.seconds for result in results),
            fates,
        )
        try:
            tasks.keep(self._folder.shards, task, computed)
        except OSError as reason:
            return [Outcome(task, "broken", why=tasks.cannot_keep(self._folder.path, reason))]
        return [Outcome(task, "done", Done(computed.seconds, computed.failed))]

    def close(self) -> None:
        self._waiting.clear()

    def check(self, before: Mapping[str, str], benches: Any, what: str) -> None:
        """Raise Problem E353 where cases were driven at other ports, or on other benches (real motors with their load).

        before   ports by joint;  benches: what told its bench from others, in words by name, by joint
        what     the place of those cases, in words
        """
        helps = "`--fresh` starts over, and removes what is done; `-o OTHER.h5` leaves it, and runs beside it"
        for joint, port in before.items():
            message = f"{what}, driven at `{port}`, and is left as it is"
            if not same_bed(port, self.ports.by_joint.get(joint, "")):
                raise Problem(error("E353", message, help=helps))
            now = self.benches[joint]
            then = benches.get(joint, {}) if isinstance(benches, dict) else {}
            if then != now and ((isinstance(then, dict) and then) or port != self.ports.by_joint[joint]):
                raise Problem(error("E353", message, help=changed_since(_other_bench(then, now))))

    def _case(self, section: CampaignSection, row: int) -> tuple[CaseResult, str]:
        """Drive a case, or use its records. Returns the result, and the reason why it ended early, "" where it did
        not."""
        path = self._folder.beds / f"{section.experiment}-{row}.records"
        ended_file = path.with_suffix(".ended")
        try:
            if not _recorded(path):
                path.unlink(missing_ok=True)
                self._drive(section, row, path, ended_file)
            result = case_result(path, section.prepared, row)
        except records.UnsoundRecords as reason:
            message = f"the file of records of case #{row} {reason}"
            raise Problem(error("E413", message, help=f"remove {path}")) from None
        except OSError as reason:
            message = f"the records of case #{row}, {reason.filename or path}: {reason.strerror or reason}"
            raise Problem(error("E413", message, help="is the disk full? who may write there?")) from None
        self.known.add(section.experiment, row, result.head, result.exchanges)
        why = "" if result.whole else "the host was gone"
        with contextlib.suppress(OSError, ValueError, LookupError, TypeError):
            why = str(read_json(ended_file)["why"]) or why
        if not why:
            return result, ""
        time = float(result.outputs[2]) / section.prepared.experiment.structure.schedule.base_hz
        self._say(f"case #{section.prepared.experiment.cases.table[row]}, t = {time:g} s: {why}")
        return result, f"t = {time:g} s: {why}"

    def _drive(self, section: CampaignSection, row: int, path: Path, ended_file: Path) -> None:
        """Drive a case in a process of its own. Raises Problem, OSError, and KeyboardInterrupt once that process has
        stopped the beds."""
        ports = self.ports
        experiment = section.prepared.experiment
        plan = plan_file.dumps(Plan("", (replace(experiment, notes=()),)))
        transcripts = {
            joint: str(ports.transcripts / f"{experiment.name}.{row}.{joint}.transcript")
            for joint in ports.by_joint
            if ports.transcripts is not None
        }
        begun = [name for name in transcripts.values() if not Path(name).exists()]
        request = CaseRequest(
            plan=plan,
            row=row,
            ports=dict(ports.by_joint),
            records=str(path),
            lock_step=ports.lock_step,
            baud=ports.baud,
            rest=ports.rest if self.known.cases else 0.0,
            transcripts=transcripts,
            clear=ports.clear,
            head={"key": section.key(), "ports": dict(ports.by_joint), "benches": self.benches},
        )
        structure, schedule = experiment.structure, experiment.structure.schedule
        exchange_hz = pace_of(experiment).hz * len(structure.substitutions)
        self.driving = Driving(path, exchange_hz, schedule.ticks / schedule.base_hz)
        ended: dict[str, Any] | None = None
        try:
            for line in talk("hw.driving.case", request, self._say, until="began", idle=self._tell):
                if "about" in line:
                    bed = f"bed `{line['about']['name']}`, firmware {line['about']['firmware']}"
                    self._greeted(line["bed"], bed, line.get("unseen", ""))
                ended = line.get("ended", ended)
        except Problem as problem:
            code = problem.diagnostics[0].code
            if code == ANOTHER or not _recorded(path):  # no result: it is driven again
                for name in (path, *map(Path, begun)):
                    name.unlink(missing_ok=True)
                raise
            ended = {"why": problem.diagnostics[0].message}
            if code == FULL:
                raise
        finally:
            self.driving = None
            if ended is not None:
                # the case's own message about a full disk takes precedence
                with contextlib.suppress(OSError), new_file(ended_file) as file:
                    file.write(json.dumps(ended).encode())

    def _greeted(self, joint: str, bed: str, unseen: str) -> None:
        """Print which bed a joint is on, and what is not noticed there, where it differs from the case before."""
        if self._greeted_beds.get(joint) != bed:
            self._greeted_beds[joint] = bed
            self._say(f"{joint}: {bed}")
            if unseen:
                self._say(f"{joint}: {unseen}")


def _other_bench(then: Any, now: Mapping[str, str]) -> list[str]:
    """The differences between two benches. then, now: in words by name"""
    if not isinstance(then, dict) or not then:
        return ["the bench; which it was is not known"]
    names = [name for name in dict.fromkeys([*then, *now]) if then.get(name) != now.get(name)]
    return [f"the bench, {name}: {then.get(name) or 'none'} -> {now.get(name) or 'none'}" for name in names]


def _recorded(path: Path) -> bool:
    """True where the file has records of a bed that was armed. Raises records.UnsoundRecords, OSError."""
    return path.exists() and len(records.read(path).rows) > 0
