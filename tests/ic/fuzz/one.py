"""One deck through all of the compiler, as a user's deck goes: checked, told about, printed and written as a plan."""

from __future__ import annotations

import resource
import signal
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from types import FrameType

import ic
from ic.driver.compile import Compiled, Select
from met.messages.programs import to_json, to_sarif
from met.messages.render import render

MOST_SECONDS = 20.0  # of processor time
MOST_MEMORY = 1 << 30  # bytes, besides what the program itself takes
MOST_LINES = 20_000  # printed of a plan
MOST_CASES = 1_000  # of a plan that is written


class Hung(BaseException):
    """The deck has taken its time."""


def fault_of(
    path: Path, select: Select = "all", also: Callable[[Compiled], None] | None = None, vary: Sequence[str] = ()
) -> tuple[str, str] | None:
    """What is wrong with MET as this deck shows it: a short name of it, and its traceback; None if nothing is.

    vary  what the command line varies, as `ic.check` takes it
    also  what else to try with the deck, once it has compiled
    """
    try:
        with _limited_time():
            compiled = _all_of_it(path, select, vary)
            if also is not None and compiled.plan is not None:
                also(compiled)
    except (Exception, Hung, RecursionError) as fault:
        frames = traceback.extract_tb(fault.__traceback__)
        own = [frame for frame in frames if "/ic/" in frame.filename or "/met/" in frame.filename] or frames
        where = f"{Path(own[-1].filename).name}:{own[-1].name}"
        told = "".join(traceback.format_exception(fault, limit=-30))
        return f"{type(fault).__name__} in {where}", told
    return None


def _all_of_it(path: Path, select: Select, vary: Sequence[str]) -> Compiled:
    compiled = ic.check(path, select=select, vary=vary)
    errors = [d for d in compiled.diagnostics if d.severity == "error"]
    assert (compiled.plan is None) == bool(errors), "a plan and errors, or neither"
    text = render(compiled.diagnostics, compiled.sources)
    assert "\x1b" not in text and "\x00" not in text, "a message could steer the terminal"
    assert all(d.at is not None or _of_a_file(d.code) for d in errors), "an error without a place"
    to_json(compiled.diagnostics, compiled.sources)
    to_sarif(compiled.diagnostics, compiled.sources)
    if compiled.plan is None:
        return compiled
    from ic.printing.cases import print_cases
    from ic.printing.check import notes, verdict
    from ic.printing.plan import print_plan
    from met.plan import file as plan_file

    verdict(compiled.plan, compiled.diagnostics)
    experiments = compiled.plan.experiments
    if not experiments:
        return compiled
    for lines in (notes(compiled.plan), print_plan(compiled.plan, verbose=True), print_cases(experiments)):
        for _ in islice(lines, MOST_LINES):
            pass
    if any(each.cases.count > MOST_CASES for each in experiments):
        return compiled
    written = plan_file.dumps(compiled.plan)
    assert plan_file.dumps(plan_file.loads(written)) == written, "a plan that is not read as it was written"
    return compiled


def _of_a_file(code: str) -> bool:
    """Codes of errors about a whole file, or about too many errors: these have no line."""
    return code in ("D001", "D002", "D018") or code.startswith(("D16", "D17"))


@contextmanager
def _limited_time() -> Iterator[None]:
    def stop(_signal: int, _frame: FrameType | None) -> None:
        raise Hung(f"more than {MOST_SECONDS} s")

    signal.signal(signal.SIGPROF, stop)
    signal.setitimer(signal.ITIMER_PROF, MOST_SECONDS)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)


def limit_memory() -> None:
    """From here on this process can have only so much memory more; beyond it there is a MemoryError."""
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + MOST_MEMORY, size + MOST_MEMORY))
