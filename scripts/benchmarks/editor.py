"""From a keystroke to what an editor shows of it: processor time of a check, as the process of `ic.editor.checker` does
it, which forks for each; without the fork, and without the language server's own part. What is told first is what
cannot be read, and what is known of definitions that have not changed; the rest where it is found soon enough.

Words at random places of a deck are taken away and written again, letter by letter, by somebody who types five letters
a second: where a check takes longer than that it is ended once it has told something, and knows no more than the last
one that came to its end.
"""

from __future__ import annotations

import gc
import pickle
import random
import re
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from benchmarks.benchmark import Benchmark, Derived, Target, ratio
from ic.editor.checking import CheckRequest, FoundAnswers, compiled_with_reply, first_replies
from ic.text.files import LIBRARY

TITLE = "editor: from a keystroke to diagnostics, s"

BETWEEN = 0.2
"""Seconds from one letter to the next."""

WORDS = 5
"""Number of words that are typed again in each deck."""

JOINTS, ROW, LINES = 150, 50, 1895


def long_arms() -> str:
    """A deck of 1,895 lines: an arm of 150 joints in three chains, 5 servos, 8 runs, 6 sweeps."""
    out = ["#include <servos/rigid_gearbox.ic>"]
    out += [f"let mass_{k} = {1 + 0.1 * k:.1f} kg;" for k in range(10)]
    for k in range(5):
        out += [
            f"servo drive_{k} like rigid_gearbox {{",
            f"    ratio = {50 + k};",
            "    command = rate(0.01 rad/s);",
            "}",
        ]
    out.append("arm many {")
    for i in range(JOINTS):
        begins = i % ROW == 0
        out += [
            f"    link link_{i} {{",
            f"        mass = mass_{i % 10};",
            "        shape = rod(length = 0.2 m, along = x);",
            "    }",
            f"    joint joint_{i} revolute {{",
            f"        parent = {'base' if begins else f'link_{i - 1}'};",
            f"        child = link_{i};",
            f"        at = [{0.0 if begins else 0.2} m, 0 m, 0 m];",
            "        axis = z;",
            "    }",
        ]
    out += ["}", "run hold_0 {", "    arm = many;", "    rates { dynamics = 1 kHz; servos = 1 kHz; record = 100 Hz; }"]
    out += ["    duration = 1 s;", "    record = [q];", "    metric top = max { of = joint_0.qd; }", "    servos {"]
    out += [f"        joint_{i} = drive_{i % 5};" for i in range(JOINTS)]
    out += ["    }", "}"]
    for r in range(1, 8):
        out += [f"run hold_{r} like hold_0 {{", f"    duration = {r + 1} s;"]
        out += [f"    initial {{ joint_{r}.q = {0.1 * r:.1f} rad; }}", "}"]
    for s in range(6):
        out += [f"sweep over_{s} of hold_{s} {{", f"    vary drive_{s % 5}.ratio = 40 .. 60 by 5;"]
        out += [f"    vary mass_{s} = [1 kg, 2 kg];", "}"]
    out += [f"// line {n}" for n in range(len(out) + 1, LINES + 1)]
    return "\n".join(out) + "\n"


def keystrokes(text: str, words: int, seed: int = 1) -> Iterator[str]:
    """The text after each keystroke."""
    chance = random.Random(seed)
    code = list(re.finditer(r"[\w.]+", re.sub(r"//.*", lambda comment: " " * len(comment[0]), text)))
    for word in chance.sample(code, words):
        first, last = word.span()
        for end in (*range(last - 1, first - 1, -1), *range(first + 1, last + 1)):
            yield text[:first] + text[first:end] + text[last:]


class _Ended(BaseException):
    """Raised in a check with a first report, when the next letter is typed."""


def _end(_signal: int, _frame: object) -> None:
    raise _Ended


@cache
def delays(name: str) -> tuple[list[float], list[float]]:
    """Seconds from each keystroke of a deck until something is told of it, and until all but the audit is, both in
    order, of those that are waited for."""
    text = _text(name)
    known, first, all_told = _known(text), [], []
    gc.collect()
    gc.freeze()
    before = gc.get_threshold()
    gc.set_threshold(50_000)  # as in the process that checks
    signal.signal(signal.SIGPROF, _end)
    try:
        for now in keystrokes(text, WORDS):
            began = time.process_time()
            try:
                for count, reply in enumerate(first_replies(_request(now, known), time.process_time)):
                    pickle.dumps(reply)
                    taken = time.process_time() - began
                    if count == 0:
                        first.append(taken)
                    if reply.known is not None or reply.audited:
                        all_told.append(taken)
                        known = reply.known if reply.known is not None else known
                        break
                    signal.setitimer(signal.ITIMER_PROF, max(BETWEEN - taken, 1e-3))
            except _Ended:
                pass
            finally:
                signal.setitimer(signal.ITIMER_PROF, 0)
        return sorted(first), sorted(all_told)
    finally:
        gc.set_threshold(*before)
        gc.unfreeze()


def _request(text: str, known: object) -> CheckRequest:
    return CheckRequest(str(Path.cwd()), "", text, (), (), {}, known)  # type: ignore[arg-type]


def _known(text: str) -> object:
    return list(first_replies(_request(text, {})))[-1].known


def _delay(share: float, which: int, name: str) -> Callable[[], float]:
    def measure() -> float:
        sorted_delays = delays(name)[which]
        return sorted_delays[int(share * (len(sorted_delays) - 1))]

    return measure


@cache
def _warm_up() -> None:
    """Import the modules of an audit, as in the checking process."""
    compiled_with_reply(_request(_text("two_link"), {}))


def _audit(name: str) -> Callable[[], float]:
    _warm_up()

    def measure() -> float:
        began = time.process_time()
        compiled_with_reply(_request(_text(name), {}))
        return time.process_time() - began

    return measure


def _audit_again(name: str) -> Callable[[], float]:
    """The second audit, of the deck with a new first line and another duration of its last run."""
    answers: list[FoundAnswers] = []
    compiled_with_reply(_request(_text(name), {}), answers.append)
    head, last, tail = _text(name).rpartition("duration = ")
    request = replace(_request(f"// a line\n{head}{last}1{tail}", {}), answers=answers[-1].pickled)

    def measure() -> float:
        began = time.process_time()
        compiled_with_reply(request)
        return time.process_time() - began

    return measure


def _text(name: str) -> str:
    return long_arms() if name == "long" else (LIBRARY / f"{name}.ic").read_text()


DECKS = {"two_link": 0.1, "station_arm": 0.1, "long": 0.25}
"""Decks, with the time limit of the first report, s."""

BENCHMARKS: tuple[Benchmark | Derived, ...] = tuple(
    benchmark
    for name, most in DECKS.items()
    for benchmark in (
        Benchmark(f"editor.{name}.p50", "told, half of all keystrokes", "s", partial(_delay, 0.5, 0, name), turns=1),
        Benchmark(
            f"editor.{name}.p95", "told, 95 % of all keystrokes", "s", partial(_delay, 0.95, 0, name), Target(most), 1
        ),
        Benchmark(
            f"editor.{name}.all.p95", "all but the audit, of what is waited for", "s", partial(_delay, 0.95, 1, name),
            turns=1,
        ),
        Benchmark(f"editor.{name}.audit", "all, as `met check`", "s", partial(_audit, name), turns=1, slow=True),
        Benchmark(
            f"editor.{name}.audit.again", "the same, where a line has moved and a run has another duration", "s",
            partial(_audit_again, name), Target(2.0), 1, True,
        ),
        ratio(f"editor.{name}.audit.kept", "of an audit, what the next one takes", over=f"editor.{name}.audit.again",
              under=f"editor.{name}.audit"),
    )
)  # fmt: skip
