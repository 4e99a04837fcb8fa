"""A process that runs tasks for this one, and may die or hang without affecting more than its task.

Parent and child talk in lines of JSON: {"task": [section, first, last]} one way; the other way {"begun": []} once there
is a kernel, {"progress": cases}, and {"done": [seconds, failed]} or {"broken": why}. A child whose parent is gone ends.
"""

from __future__ import annotations

import errno
import json
import os
import select
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from batch.campaigns.drive import Outcome
from batch.campaigns.output import more_files
from batch.campaigns.tasks import Done, Task
from met.host import interpreter
from met.outputs import refusal_text

COMMAND = tuple(interpreter.command("batch.executors.worker"))
WATCH_SECONDS = 0.2

STILLBORN = 3
"""Number of successive workers killed before they have begun, after which no more are started: the cause is not a
case."""

NO_MEMORY = 3
"""Exit status of a process that could not get the memory it needs; fewer cases at once may do."""


class Child:
    """One process, with one task at a time."""

    def __init__(self, folder: Path, threads: int, command: Sequence[str] = COMMAND) -> None:
        """Start the process. folder: the campaign's; threads: for a task's cases. Raises OSError where it cannot be
        started."""
        self.under_way = 0
        self._words = tempfile.TemporaryFile()  # noqa: SIM115 - what it says on stderr, while it lives
        try:
            self._process = subprocess.Popen(
                [*command, str(folder.resolve()), "--threads", str(threads)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._words,
                env={**interpreter.environment(), "OMP_NUM_THREADS": "1"},
                start_new_session=True,
            )
        except OSError:
            self._words.close()
            raise
        self._read = b""
        self._ended = False
        self.begun = False

    def carry_out(self, task: Task, timeout: float | None = None) -> Outcome:
        """Run a task, and wait for its outcome. timeout: s without any progress, once there is a kernel."""
        self.under_way = 0
        try:
            assert self._process.stdin is not None
            self._process.stdin.write(json.dumps({"task": [task.section, task.first, task.last]}).encode() + b"\n")
            self._process.stdin.flush()
        except OSError:
            return self._death(task)
        begun, last = False, time.monotonic()
        while True:
            message = self._message(WATCH_SECONDS)
            now = time.monotonic()
            if message is None:
                if self._ended:
                    return self._death(task)
                if begun and timeout is not None and now - last > timeout:
                    return Outcome(task, "stalled", why=f"no progress for {timeout:g} s")
                continue
            last = now
            begun = (begun or "begun" in message) and "computed" not in message
            self.begun = self.begun or begun
            self.under_way = message.get("progress", self.under_way)
            if "done" in message:
                self.under_way = 0
                return Outcome(task, "done", done=Done(*message["done"]))
            if "broken" in message:
                return Outcome(task, "broken", why=message["broken"])

    def kill(self) -> None:
        """Kill the process at once; its waiting callers get the outcome that it is lost."""
        self._process.kill()

    def end(self) -> None:
        """Kill the process, and release its resources."""
        self.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout, self._words):
            with suppress(OSError):  # what was not sent when it died
                if pipe is not None:
                    pipe.close()

    def _message(self, seconds: float) -> dict[str, Any] | None:
        """The next message; None where there is none within this time, or none any more (`_ended`)."""
        assert self._process.stdout is not None
        pipe = self._process.stdout.fileno()
        poll = select.poll()
        poll.register(pipe, select.POLLIN)
        while b"\n" not in self._read:
            if not poll.poll(1000.0 * seconds):
                return None
            more = os.read(pipe, 1 << 16)
            if not more:
                self._ended = True
                return None
            self._read += more
        line, _, self._read = self._read.partition(b"\n")
        message: dict[str, Any] = json.loads(line)
        return message

    def _death(self, task: Task) -> Outcome:
        """The outcome of a task whose process is dead: lost if it was killed; broken if it ended by itself, since
        another try would not help."""
        status = self._process.wait()
        if status < 0:
            name = {number.value: number.name for number in signal.Signals}.get(-status, f"signal {-status}")
            return Outcome(task, "lost", why=f"was killed by {name}")
        if status == NO_MEMORY:
            return Outcome(task, "lost", why="had too little memory")
        self._words.seek(0)
        last = self._words.read().decode(errors="replace").strip().splitlines()[-1:]
        return Outcome(task, "broken", why=f"a worker ended with status {status}" + (f": {last[0]}" if last else ""))


def _no_start(reason: OSError) -> str:
    """The reason in words why a worker cannot be started, with what may help."""
    why = refusal_text(reason)
    if reason.errno in (errno.EMFILE, errno.ENFILE):
        return f"a worker cannot be started: {why}; {more_files()}"
    fewer = "; fewer processes may do" if reason.errno in (errno.ENOMEM, errno.EAGAIN) else ""
    return f"a worker cannot be started: {why}{fewer}"


class Crew:
    """Children that take one task after the other; calls block. Several threads may call at once."""

    def __init__(
        self, folder: Path, *, threads: int = 1, timeout: float | None = None, command: Sequence[str] = COMMAND
    ) -> None:
        self._folder, self._threads, self._timeout, self._command = folder, threads, timeout, command
        self._all: list[Child] = []
        self._idle: list[Child] = []
        self._lock = threading.Lock()
        self._over = False
        self._stillborn = 0

    @property
    def under_way(self) -> int:
        """Number of finished cases of unfinished tasks."""
        return sum(child.under_way for child in list(self._all))

    def carry_out(self, task: Task) -> Outcome:
        """Run a task by an idle child, or by a new one."""
        try:
            child = self._take()
        except OSError as reason:
            return Outcome(task, "broken", why=_no_start(reason))
        try:
            outcome = child.carry_out(task, self._timeout)
        except BaseException:
            self._discard(child)
            raise
        if outcome.kind == "done":
            with self._lock:
                self._idle.append(child)
                self._stillborn = 0
            return outcome
        self._discard(child)
        if outcome.kind == "lost" and not child.begun and not self._over:
            self._stillborn += 1
            if self._stillborn >= STILLBORN:
                why = f"{STILLBORN} workers in a row died before they began; the last one {outcome.why}"
                return Outcome(task, "broken", why=why)
        return outcome

    def stop(self) -> None:
        """Kill all children at once; callers that wait for one get the outcome that it is lost."""
        with self._lock:
            self._over = True
            for child in self._all:
                child.kill()

    def close(self) -> None:
        """Kill all children and release them, when nobody waits for one any more."""
        self.stop()
        with self._lock:
            ending, self._all, self._idle = self._all, [], []
        for child in ending:
            child.end()

    def _take(self) -> Child:
        """A process that has no task, started where there is none."""
        with self._lock:
            if self._idle:
                return self._idle.pop()
            if self._over:
                raise RuntimeError("the crew has been sent home")
            child = Child(self._folder, self._threads, self._command)
            self._all.append(child)
            return child

    def _discard(self, child: Child) -> None:
        """End a process, and forget it."""
        with self._lock:
            mine = child in self._all
            if mine:
                self._all.remove(child)
        if mine:
            child.end()
