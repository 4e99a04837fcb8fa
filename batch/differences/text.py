"""A comparison as text for people: provenance, status, signals and metrics, and then the worst cases."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from batch.differences import words
from batch.differences.result import Diff, ExperimentDiff, SignalDiff
from ic.printing.columns import columns
from met.frozen import frozen

MOST_LINES, OF_KIND = 12, {"deck": 24, "follows": 6}
"""Largest number of printed lines of one kind of change; other numbers for some kinds."""

SHOWN_ENDED, SHOWN_WORST, SHOWN_EVIDENCE = 8, 5, 12

LONGEST = 120
"""Largest number of characters of a deck's line."""


@frozen
class Shortening:
    """The shortening of a long text. every: True to leave nothing out; remedy: the command that shows all."""

    every: bool = False
    remedy: str = "`met diff ... --all`"

    def cut(self, lines: Sequence[str], most: int, indent: str) -> list[str]:
        """The first of the lines, and the number of omitted ones."""
        left = 0 if self.every else max(0, len(lines) - most)
        return [*lines[: len(lines) - left], *([f"{indent}and {left:,} more: {self.remedy}"] if left else [])]


def diff_lines(difference: Diff, cut: Shortening | None = None) -> list[str]:
    """The whole comparison in lines, for people; a line about omitted parts says how to see them."""
    cut = cut or Shortening()
    out = [f"a  {difference.a}", f"b  {difference.b}", *_changed(difference, cut)]
    for line in words.unmatched_runs(difference):
        out += ["", line]
    for experiment in difference.experiments:
        out += ["", *_experiment(difference, experiment, cut)]
    return [*out, "", words.verdict(difference)]


def _changed(difference: Diff, cut: Shortening) -> Iterator[str]:
    """The lines about what was changed between two archives: deck, models, MET."""
    lines_of = words.provenance_lines(difference)
    yield ""
    if not lines_of:
        yield words.SAME
    for kind, lines in lines_of:
        short = lines if cut.every else _shortened(lines)
        for line in cut.cut(short, OF_KIND.get(kind, MOST_LINES), ""):
            yield f"  {'' if line.startswith(' ') else kind:<10} {line}"


def _shortened(lines: Sequence[str]) -> list[str]:
    """The lines, of which long ones are cut where they begin to differ from their counterparts: of `-` and `+` lines of
    a deck's difference, one by one, and of both sides of `BEFORE -> NOW`."""
    out = list(lines)
    for gone, new in _counterparts(lines):
        out[gone], out[new] = _around(lines[gone], lines[new], LONGEST, len("  -"))
    for number, line in enumerate(out):
        before, arrow, now = line.partition(" -> ")
        if len(line) > LONGEST + len(" ... ") * 2 and arrow and " -> " not in now:
            head = before.rfind(": ") + len(": ") if ": " in before else 0
            first, other = _around(before[head:], now, LONGEST // 2, 0)
            out[number] = line = f"{before[:head]}{first}{arrow}{other}"
        elif line == lines[number] and len(line) > LONGEST:
            out[number] = f"{line[:LONGEST]} ..."
    return out


def _counterparts(lines: Sequence[str]) -> Iterator[tuple[int, int]]:
    """The numbers of the `-` and `+` lines of a deck's difference that stand for each other, in their order."""
    gone: list[int] = []
    new: list[int] = []
    for number, line in enumerate([*lines, ""]):
        if line.startswith("  -") and not new:
            gone.append(number)
        elif line.startswith("  +"):
            new.append(number)
        else:
            yield from zip(gone, new, strict=False)
            gone, new = ([number], []) if line.startswith("  -") else ([], [])


def _around(line: str, other: str, most: int, head: int) -> tuple[str, str]:
    """Two lines, each cut to `most` characters about the first difference behind the head."""
    both = line[head:], other[head:]
    first = next((i for i, (x, y) in enumerate(zip(*both, strict=False)) if x != y), min(map(len, both)))
    begin = head + max(0, first - most // 3)
    if max(len(line), len(other)) <= most:
        return line, other
    if first + most // 3 < most - head:
        begin = head
    pieces = []
    for text in (line, other):
        before = "... " if begin > head else ""
        after = " ..." if len(text) > begin + most else ""
        pieces.append(f"{text[:head]}{before}{text[begin : begin + most]}{after}")
    return pieces[0], pieces[1]


def _experiment(difference: Diff, experiment: ExperimentDiff, cut: Shortening) -> Iterator[str]:
    """The lines about a run or sweep that both archives have."""
    yield from [words.heading(experiment), *(f"  {line}" for line in words.unmatched_cases(difference, experiment))]
    yield from _ended(experiment, cut)
    yield from [f"  note: {note}" for note in experiment.notes]
    yield from [f"  {line}" for line in words.tolerance_lines(difference, experiment)]
    yield from [f"  {line}" for line in words.requirement_lines(experiment)]
    yield from _evidence(experiment, cut)
    yield from _signals(experiment.signals)
    yield from _paired(experiment)
    yield from _samples(experiment)
    yield from _worst(difference, experiment, cut)


def _evidence(experiment: ExperimentDiff, cut: Shortening) -> list[str]:
    """Lines on requirements over a share of cases of which the two archives show another verdict."""
    both = [f"    {what}\n      {text}" for what, text in words.evidence_pairs(experiment)]
    lines = [line for block in cut.cut(both, SHOWN_EVIDENCE, "    ") for line in block.split("\n")]
    return [f"  {words.EVIDENCE}:", *lines] if lines else []


def _ended(experiment: ExperimentDiff, cut: Shortening) -> Iterator[str]:
    """Cases that end otherwise, in kinds."""
    for ending in words.endings(experiment):
        yield f"  {ending.text}: {ending.cases}"
        cases = [f"    #{case.case} {case.case_id[:8]}  {words.cause(case)}" for case in ending.case_endings]
        yield from cut.cut(cases, SHOWN_ENDED, "    ")


def _signals(signals: Sequence[SignalDiff]) -> list[str]:
    """The table of signals and metrics that both archives have, a row each."""
    if not signals:
        return []
    rows = [words.signal_row(signal) for signal in signals]
    heads: list[str] = []
    fields: list[str] = []
    right: list[int] = []
    for column in words.signal_columns(rows):
        right += [len(fields)] if column.kind == "number" else []
        heads.append(column.head)
        fields.append(column.field)
        if column.unit and any(getattr(row, column.unit) for row in rows):  # in a column of its own
            heads.append("")
            fields.append(column.unit)
    return columns([heads, *([getattr(row, field) for field in fields] for row in rows)], right=right)


def _paired(experiment: ExperimentDiff) -> list[str]:
    """Metrics as pairs of the same cases."""
    lines = words.paired_metrics(experiment)
    return ["", f"  {words.PAIRED}:", *(f"    {line}" for line in lines)] if lines else []


def _samples(experiment: ExperimentDiff) -> list[str]:
    """The table of metrics as distributions of both archives."""
    if not experiment.samples:
        return []
    rows = [[head for head, _ in words.DISTRIBUTION_HEADS]]
    rows += [list(words.distribution(sample).cells) for sample in experiment.samples]
    rows = [[f"  {first}", *others] for first, *others in rows]
    note = words.star_note(experiment)
    return ["", *columns(rows, right=range(1, 7)), *([f"  {note}"] if note else [])]


def _worst(difference: Diff, experiment: ExperimentDiff, cut: Shortening) -> list[str]:
    """The lines about the cases that differ most, with commands that show them."""
    if not experiment.worst:
        return []
    out = []
    for worst_case in words.worst_cases(difference, experiment):
        now = f"{worst_case.now} {worst_case.unit}".rstrip()
        first = f"    #{worst_case.case} {worst_case.id}  {worst_case.what}: {worst_case.before}, now {now}"
        out.append(f"{first}\n      {'; '.join(worst_case.commands)}")
    few = cut.cut(out, SHOWN_WORST, "    ")
    return ["", f"  {words.WORST}:", *(line for block in few for line in block.split("\n"))]
