"""A process of its own that speaks to beds, and the process that starts it: how they talk with one another.

It is asked one thing, a frozen dataclass, in a line of JSON on its standard input, and answers in lines of JSON:
{"said": words, "help": [...]} for people, {"wrong": diagnostics} where it cannot go on, and what else it has to say.
It hears when it is interrupted or terminated, and is terminated when who started it is no more: its beds are stopped.

    in the process     listening, say, warnings, precedence; answer
    who started it     talk
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from typing import Any, TypeVar

from hw import realtime
from hw.bed import About, BedDriver
from met.diagnostic import Problem, error
from met.host import interpreter
from met.messages.programs import to_json

PAUSE = 0.1
"""s between two calls of `idle` while the process says nothing."""

_STARTED_BY = "MET_STARTED_BY"
"""The environment variable with the process id of the one that started this process. An orphan's parent need not be
1, and in a container a parent of that id need not have ended."""

Question = TypeVar("Question")


# In the process


def listening() -> Callable[[], bool]:
    """Hear signals from here on, but those that `nohup` or a shell had ignored. Returns a function that is True once
    one has asked to stop, or the process that started this one has ended."""
    heard: list[int] = []
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number == signal.SIGTERM or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, lambda which, _: heard.append(which))
    parent = int(os.environ.get(_STARTED_BY) or os.getppid())
    return lambda: bool(heard) or os.getppid() != parent


def say(**data: Any) -> None:
    """Write a line of JSON to the standard output, whether or not someone still reads it."""
    with contextlib.suppress(BrokenPipeError):
        os.write(sys.stdout.fileno(), (json.dumps(data) + "\n").encode())


def about_as_json(about: About) -> dict[str, Any]:
    """The description of a bed, as `say` writes it."""
    return {**asdict(about), "capabilities": int(about.capabilities)}


def warnings(bed: BedDriver) -> None:
    """Report conditions that may make exchanges with a bed late, or differences of a bench from the deck."""
    for warning in bed.warnings:
        place = warning.at.place if warning.at else None
        text = warning.message if place is None else f"{place.file}:{place.line}: {warning.message}"
        say(said=text, help=list(warning.help))


def unseen(bed: BedDriver) -> str:
    """A line about what another master may do to a bed without being noticed; "" where there can be none."""
    return f"another master is noticed and stops the bed; not noticed are {bed.unseen}" if bed.unseen else ""


def precedence() -> None:
    """Take precedence over other processes, and report what was not allowed."""
    for refused in realtime.take_precedence():
        say(said=refused)


def answer(question: Callable[..., Question], do: Callable[[Question], Mapping[str, Any]]) -> None:
    """The whole of the process: read the question, carry it out, and print the result, or the error."""
    try:
        result = do(question(**json.loads(sys.stdin.readline())))
    except Problem as problem:
        say(wrong=json.loads(to_json(problem.diagnostics)))
        sys.exit(1)
    say(**result)


# Who started it


def talk(
    module: str,
    question: Any,
    hear: Callable[[str], None],
    *,
    until: str = "",
    idle: Callable[[], None] = lambda: None,
    goes_on: bool = False,
) -> Iterator[dict[str, Any]]:
    """Start `python -m MODULE`, ask it, and give what it says, line by line. Raises Problem for what it says is wrong.

    hear     takes what is for people
    until    a word that must come; where the process ends without it, that is Problem E417
    idle     called now and then while it says nothing
    goes_on  whether an interrupt, which ends the process, ends no more than that where it has come to `until`; else it
             is raised in the end
    """
    process = subprocess.Popen(
        interpreter.command(module),
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**interpreter.environment(), _STARTED_BY: str(os.getpid())},
    )
    assert process.stdin is not None and process.stdout is not None
    interrupted: KeyboardInterrupt | None = None
    came = False
    try:
        with contextlib.suppress(BrokenPipeError):  # it may have ended already
            process.stdin.write((json.dumps(asdict(question)) + "\n").encode())
        with contextlib.suppress(BrokenPipeError):
            process.stdin.close()
        rest, file = b"", process.stdout.fileno()
        while True:
            try:
                if not select.select([file], [], [], PAUSE)[0]:
                    idle()
                    continue
                data = os.read(file, 1 << 16)
            except KeyboardInterrupt as reason:
                interrupted = reason
                process.terminate()  # it hears an interrupt of the terminal, but not one that this alone was sent
                continue
            if not data:
                break
            *whole, rest = (rest + data).split(b"\n")
            for line in map(json.loads, whole):
                if "wrong" in line and interrupted is not None:
                    raise interrupted
                if "wrong" in line:
                    diagnostics = line["wrong"]["diagnostics"]
                    raise Problem(
                        [
                            error(diagnostic["code"], diagnostic["message"], help=diagnostic["help"])
                            for diagnostic in diagnostics
                        ]
                    )
                if "said" in line:
                    hear(" ".join([line["said"], *(f"({remedy})" for remedy in line.get("help", ()))]))
                came = came or until in line
                yield line
    except BaseException:  # also of whoever reads the lines
        process.terminate()
        raise
    finally:
        process.stdout.close()
        process.wait()
    if interrupted is not None and not (goes_on and came):
        raise interrupted
    if until and not came:
        raise ended(process.returncode)


def ended(status: int) -> Problem:
    """The error that the process which drives the beds has ended, with its exit status."""
    message = f"the process that drives the beds ended with {status}"
    return Problem(error("E417", message, help="the beds stop themselves; run it again"))
