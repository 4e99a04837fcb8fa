"""Models of other packages, recorded in a process of their own first: one that crashes, ends or never ends there takes
along that process, and not the command.

    python -m batch.campaigns.rehearsal < question

The question is JSON, the arguments of `read_plan`. On standard output it says what it is at, a line each, and in the
end `done`, also where something is wrong that has words: that is found and told again where it is read in earnest. On
standard error, Python says where it was when it ended otherwise.
"""

from __future__ import annotations

import faulthandler
import json
import linecache
import os
import re
import resource
import signal
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from met import models
from met.diagnostic import Label, Place, Problem, error
from met.host import interpreter
from met.host.entry_points import PACKAGE, offered

LEAST_SECONDS = 60.0
"""The least time limit for reading and recording, s, even if that of a case is shorter."""

END_SECONDS = 5.0
"""Seconds after which a process that does not report its traceback is killed."""

DONE = "done"
FRAME = re.compile(r'^  File "(?P<file>.+)", line (?P<line>\d+) in (?P<name>.+)$', re.MULTILINE)


def rehearse(timeout: float | None, **question: Any) -> None:
    """Have all models of a deck or plan recorded in another process. Raises Problem E217 where that does not end well.

    timeout   s of a case without any progress; None: it may take for ever
    question  as `batch.campaigns.choosing.read_plan` takes it
    """
    if all(point.package == PACKAGE for group in models.GROUPS.values() for point in offered(group.entry_points)):
        return
    limit = None if timeout is None else max(timeout, LEAST_SECONDS)
    with tempfile.TemporaryFile() as words, tempfile.TemporaryFile() as progress_file:
        process = subprocess.Popen(
            interpreter.command("batch.campaigns.rehearsal"),
            stdin=subprocess.PIPE,
            stdout=progress_file,
            stderr=words,
            env=interpreter.environment(),
            start_new_session=True,
        )
        try:
            with suppress(BrokenPipeError):
                assert process.stdin is not None
                process.stdin.write(json.dumps(question).encode())
                process.stdin.close()
            how = _ended(process, limit)
        finally:
            process.kill()
            process.wait()
        progress_lines, error_lines = (_all_of(file).splitlines() for file in (progress_file, words))
        if progress_lines[-1:] != [DONE]:
            raise _taken_along(progress_lines[-1] if progress_lines else "", how, "\n".join(error_lines))


def _ended(process: subprocess.Popen[bytes], limit: float | None) -> str:
    """Wait for a process, at most `limit` s, and return in words how it ended; one that goes on is sent SIGABRT, so
    that it prints its traceback."""
    try:
        status = process.wait(limit)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGABRT)  # it prints its traceback
        with suppress(subprocess.TimeoutExpired):
            process.wait(END_SECONDS)
        return f"has not ended after {limit:g} s"
    if status >= 0:
        return f"ended with status {status}"
    name = {number.value: number.name for number in signal.Signals}.get(-status, f"signal {-status}")
    return f"was killed by {name}"


def _all_of(file: Any) -> str:
    file.seek(0)
    return str(file.read().decode("utf-8", "replace"))


def _taken_along(experiment: str, how: str, error_text: str) -> Problem:
    """The error about models that end the process. experiment: the recorded one, empty while the deck was read;
    error_text: a traceback of `faulthandler`, if any"""
    what = f"of `{experiment}`" if experiment else "of the deck"
    frame_match = next((frame for frame in FRAME.finditer(error_text) if _is_a_models(frame["file"])), None)
    helps = ("mend the model, or tell its author", "without `--processes` or `--timeout` it would take `met` along")
    if frame_match is None:
        message = f"the models {what} cannot be recorded: a process that tried it {how}, and nothing says where"
        return Problem(error("E217", message, help=helps))
    file, line = frame_match["file"], int(frame_match["line"])
    text = linecache.getline(file, line).rstrip()
    indent = len(text) - len(text.lstrip())
    place = Place(file, line, indent + 1, max(len(text) - indent, 1))
    message = f"a model {what} cannot be recorded: in `{frame_match['name']}`, a process that tried it {how}"
    sources = {file: "".join(linecache.getlines(file))}
    return Problem(error("E217", message, Label(place, "it was here"), help=helps), sources)


def _is_a_models(file: str) -> bool:
    """True if code is neither MET's nor Python's own, so that it is a model's."""
    home = Path(__file__).resolve().parents[2]
    ours = ("<", *(str(home / name) + os.sep for name in ("batch", "hw", "ic", "met")))
    python = [os.path.dirname(os.__file__) + os.sep, sysconfig.get_paths()["stdlib"] + os.sep]
    installed = any(f"{os.sep}{name}{os.sep}" in file for name in ("site-packages", "dist-packages"))
    return not file.startswith(ours) and (installed or not file.startswith(tuple(python)))


# In the process


def main(lines: Sequence[str]) -> None:
    """Record all models of the question, and report progress."""
    from batch.archive.read import ArchiveFile
    from batch.campaigns.choosing import read_plan
    from met.host import system
    from met.host.sources import names_archive
    from met.run import prepare

    system.end_with_parent(signal.SIGKILL)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    faulthandler.enable()
    ends = os._exit

    def end(status: int) -> None:
        faulthandler.dump_traceback()
        ends(status)

    os._exit = end  # type: ignore[assignment]  # a model that ends the process says where it does
    out = os.dup(sys.stdout.fileno())
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # a model's own output is not part of the answers

    def say(word: str) -> None:
        os.write(out, f"{word}\n".encode())

    with suppress(Exception):
        question = json.loads("".join(lines))
        if names_archive(question["source"]):
            with ArchiveFile(question["source"]) as file:
                plan = file.plan()
        else:
            plan = read_plan(**question, quiet=True)
        for experiment in plan.experiments:
            say(experiment.name)
            prepare(experiment).recording  # noqa: B018 - what a model does is done while it is recorded
    say(DONE)
    ends(0)


if __name__ == "__main__":
    main(sys.stdin.readlines())
