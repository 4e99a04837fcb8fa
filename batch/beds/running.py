"""`met bed run`: a deck's run or sweep on motor beds, into an archive like any other."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from batch.archive.read import ArchiveFile
from batch.beds.chosen_bed import on_beds, on_none, split
from batch.beds.executor import OnBeds, Ports
from batch.beds.jitter import duration, off
from batch.campaigns.campaign import Campaign, Wires, prepare
from batch.campaigns.choosing import read_plan
from batch.campaigns.output import sidecar_path
from batch.campaigns.performing import perform
from batch.queries.stability_words import in_words
from batch.queries.summary import summarise
from batch.terminal.progress import Bar
from batch.terminal.running import first_picture
from batch.terminal.verdict import RunResult, announcement, result_lines, worst_cases, writing
from hw.drivers import check_model, in_lock_step, kind_of, ports_in_words
from hw.driving.case import check, pace_of
from hw.driving.timing import TimeSpread, Timing, timing
from hw.recording.records import ANSWERED
from met.analysis.margin import margins, remedy
from met.diagnostic import Problem, error
from met.host.files import read_json
from met.host.streams import kept
from met.messages import visible
from met.messages.visible import say
from met.outputs import quoted
from met.plan import Experiment, Plan


class BedProgress:
    """Progress of a campaign on beds (`batch.campaigns.drive.Progress`): a case counts by the time that it has been
    driven."""

    def __init__(self, executor: OnBeds, *, quiet: bool, bar: Bar | None = None) -> None:
        self._executor, self._quiet = executor, quiet
        self._bar = bar or Bar()

    def begin(self, name: str, cases: int, done: int, failed: int, workers: str) -> None:
        if not self._quiet:
            self._bar.begin(name, cases, done, failed, workers)

    def advance(self, done: int, failed: int, more: str = "") -> None:
        """Show the cases that are done, and how much of the case under way has been driven, s."""
        if self._quiet:
            return
        driving = self._executor.driving
        if driving is None:
            self._bar.advance(done, failed, more)
            return
        seconds = driving.done
        driven = f"{seconds:.3g} of {driving.seconds:.6g} s"
        self._bar.advance(done + seconds / driving.seconds, failed, ", ".join(filter(None, [driven, more])))

    def end(self) -> None:
        if not self._quiet:
            self._bar.end()

    def say(self, line: str) -> None:
        """Print a line in the bar's place."""
        if not self._quiet:
            self._bar.end()
            say(line)


def timings(executor: OnBeds) -> dict[str, Timing]:
    """The timing of each joint's bed, over all cases; none where the beds are in lock-step and have no time."""
    timing_of = {}
    for joint in executor.ports.by_joint:
        cases = executor.known.of(joint)
        if cases and not executor.ports.lock_step:
            # a bed's ticks, and the host's clock, restart with each case
            drifts = [timing(rows, hz).drift for hz, rows in cases]
            known = [drift for drift in drifts if math.isfinite(drift)]
            drift = float(np.median(known)) if known else math.nan
            timing_of[joint] = replace(timing(np.concatenate([rows for _, rows in cases]), math.nan), drift=drift)
    return timing_of


WORST = 0.01
"""Share of exchanges without an answer, and error of a bed's clock, above which there is a warning."""


def timing_lines(executor: OnBeds) -> Iterator[str]:
    """Lines about the loop's timing, with a warning where it was bad."""
    for joint, times in timings(executor).items():
        late = times.woken + times.computed + times.waited
        parts = [
            ("late by", times.lateness),
            ("answered in", times.trip),
            ("computed in", times.computing),
        ]
        spreads = "; ".join(f"{what} {duration(spread.median)}, p99 {duration(spread.high)}" for what, spread in parts)
        yield f"{joint}: {times.exchanges:,} exchanges; {spreads}"
        yield (
            f"  a period late: {late:,} (woken too late {times.woken:,}, computing {times.computed:,}, waiting "
            f"{times.waited:,}); unanswered: {times.unanswered:,}; the bed's clock: {off(times.drift)}"
        )
        if abs(times.drift) > WORST:
            hz = executor.known.of(joint)[-1][0]
            yield (
                f"  warning: the bed says that it ticks at {hz:g} Hz, and ticks at {(1.0 + times.drift) * hz:.4g} Hz: "
                "its deadman and slew limits are not what it says; mend its timer, or its configuration"
            )
        if times.unanswered > WORST * times.exchanges:
            yield (
                f"  warning: {100.0 * times.unanswered / times.exchanges:.3g} % of the exchanges had no answer, and "
                "commands were held longer than was computed: `met bed jitter` and `met bed probe` say more of the line"
            )
    for joint in executor.ports.by_joint if executor.ports.lock_step else ():
        silent = sum(int(((rows["flags"] & ANSWERED) == 0).sum()) for _, rows in executor.known.of(joint))
        if silent:
            yield f"{joint}: unanswered: {silent:,}; such a run has not the bits of another"


def sidecar_entries(executor: OnBeds) -> Mapping[str, Any]:
    """The entries for the file beside the archive: the beds, and the loop's timing, s."""
    executor.know_all()
    timing_of = timings(executor)
    return {
        "beds": [
            {
                "joint": joint,
                "port": port,
                "baud": executor.ports.baud,
                "lock_step": executor.ports.lock_step,
                "beds": executor.known.beds[joint],
                **({"bench": executor.benches[joint]} if executor.benches[joint] else {}),
                "timing": _figures(timing_of[joint]) if joint in timing_of else None,
            }
            for joint, port in executor.ports.by_joint.items()
        ]
    }


def _figures(times: Timing) -> dict[str, Any]:
    """The timing of a loop's exchanges with a motor bed, for JSON: counts of late and missing answers, spreads in s."""
    spreads = {"lateness": times.lateness, "trip": times.trip, "computing": times.computing}
    return {
        "exchanges": times.exchanges,
        **{name: _spread(spread) for name, spread in spreads.items()},
        "woken_late": times.woken,
        "computed_late": times.computed,
        "answered_late": times.waited,
        "unanswered": times.unanswered,
        "clock": times.drift if math.isfinite(times.drift) else None,
    }


def _spread(time_spread: TimeSpread) -> dict[str, float | None]:
    """A duration's spread for JSON, s."""
    values = {
        "median": time_spread.median,
        "p99": time_spread.high,
        "p99.9": time_spread.highest,
        "largest": time_spread.largest,
    }
    return {name: round(value, 9) if math.isfinite(value) else None for name, value in values.items()}


def ports_of(words: Sequence[str], experiments: Sequence[Experiment]) -> dict[str, str]:
    """The port of each joint on a bed, from words `PORT` or `JOINT=PORT`. Raises Problem E418."""
    joints = list(
        dict.fromkeys(
            substitution.joint for experiment in experiments for substitution in experiment.structure.substitutions
        )
    )
    port_of: dict[str, str] = {}
    for word in words:
        joint, port = split(word)
        if joint and joint not in joints:
            raise on_none(word, joint, joints)
        if not joint and len(joints) == 1:
            joint = joints[0]
        if not joint:
            own = " ".join(f"--port {joint}=..." for joint in joints)
            raise Problem(error("E418", f"port `{word}`: of which joint?", help=f"each has its own: `{own}`"))
        if joint in port_of:
            raise Problem(error("E418", f"joint `{joint}` has two ports", help="leave one of the two out"))
        port_of[joint] = port
    lines = [os.path.realpath(port) for port in port_of.values() if not kind_of(port).simulated]
    if len(set(lines)) < len(lines):
        first, other = [joint for joint, port in port_of.items() if lines.count(os.path.realpath(port)) > 1][:2]
        message = f"joints `{first}` and `{other}` have one port: {port_of[first]}"
        raise Problem(error("E418", message, help="each has a bed of its own, and its own line"))
    missing = [joint for joint in joints if joint not in port_of]
    if missing:
        kinds = f"`--port JOINT=PORT`: {ports_in_words()}"
        raise Problem(error("E418", f"no port for the bed of joint `{missing[0]}`", help=kinds))
    return port_of


def campaign_of(
    plan: Plan,
    names: Sequence[str] | None,
    ports: Sequence[str],
    *,
    lock_step: bool = False,
    output: str | Path | None = None,
    cases: Sequence[str] | None = None,
) -> tuple[Campaign, dict[str, str], bool]:
    """The campaign, its ports by joint, and True where the beds have no time of their own. Raises Problem."""
    experiments = on_beds(plan, names)
    by_joint = ports_of(ports, experiments)
    for experiment in experiments:
        for use in experiment.structure.substitutions:
            check_model(by_joint[use.joint], experiment, use.joint)
    steps = {in_lock_step(port, lock_step) for port in by_joint.values()}
    if len(steps) > 1:
        helps = "give all beds ports of one kind"
        raise Problem(error("E414", "some of the beds have a time of their own, and some have none", help=helps))
    [stepped] = steps
    late = max(pace_of(experiment).late(stepped) for experiment in experiments)
    campaign = prepare(plan, output=output, experiments=names, cases=cases, histories="all", wires=Wires(late))
    for part in campaign.parts:
        for row in part.rows.tolist():
            check(part.experiment, row, stepped)
    return campaign, by_joint, stepped


def check_margins(campaign: Campaign, *, force: bool) -> list[str]:
    """Lines about the laws' stability, before a bed is armed. Raises Problem E419 where a law has no margin."""
    lines = []
    for part in campaign.parts:
        for cases_of_joint in zip(*margins(part.experiment, part.rows.tolist()), strict=True):
            bad = next((margin for margin in cases_of_joint if not margin.stable), None)
            if bad is not None and not force:
                helps = f"`met margin` says what would be; {remedy(bad)}", "`--force` arms it all the same"
                raise Problem(error("E419", f"case #{bad.case}, {in_words(bad)}: it would not be stable", help=helps))
            worst = min(cases_of_joint, key=lambda margin: margin.room)
            several = len({in_words(margin) for margin in cases_of_joint}) > 1
            among = f" (case #{worst.case}, the least margin of {len(cases_of_joint)} cases)" if several else ""
            lines.append(in_words(worst) + among)
    return list(dict.fromkeys(lines))


def run_and_tell(
    source: str,
    names: tuple[str, ...],
    *,
    ports: Sequence[str],
    baud: int,
    lock_step: bool = False,
    rest: float | None = None,
    clear: bool = False,
    force: bool = False,
    transcripts: str | None = None,
    output: str | None = None,
    cases: Sequence[str] = (),
    fresh: bool = False,
    no_picture: bool = False,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
    verbose: bool = False,
) -> bool:
    """Drive a deck's run or sweep; True where every case reached its end and met its requirements."""
    say: Callable[[str], None] = (lambda _: None) if quiet else visible.say
    plan = read_plan(source, names, defines=defines, include_dirs=include_dirs, settings=settings, quiet=quiet)
    campaign, by_joint, stepped = campaign_of(
        plan, names or None, ports, lock_step=lock_step, output=output, cases=cases or None
    )
    say("\n".join(announcement(campaign, verbose)))
    for line in check_margins(campaign, force=force):
        say(f"  {line}")
    folder = None if transcripts is None else Path(transcripts)
    executor = OnBeds(Ports(by_joint, baud, stepped, rest or 0.0, folder, clear), lambda line: telling.say(f"  {line}"))
    telling = BedProgress(executor, quiet=quiet)
    performed = perform(
        campaign,
        executor=executor,
        fresh=fresh,
        progress=telling,
        ready=lambda: say(writing(campaign)),
        say=telling.say,
        more=lambda: sidecar_entries(executor),
    )
    with kept(f"{campaign.output} is whole: `met show {quoted(campaign.output)}` prints what came of it"):
        if performed.whole:
            executor.check(*beds_before(campaign.output), f"{campaign.output} holds this campaign")
            say(f"nothing is missing: {campaign.output} has all of it (`--fresh` drives it again)")
        with ArchiveFile(campaign.output) as file:
            drawn = (None, "") if no_picture else first_picture(file)
            result = RunResult(summarise(file), tuple(worst_cases(file)), *drawn)
        for line in timing_lines(executor):
            say(line)
        say("\n".join(result_lines(campaign, result, None, performed)))
    return result.ok


def beds_before(archive: Path) -> tuple[dict[str, str], dict[str, Any]]:
    """The ports at which an archive's cases were driven, and what told their benches (real motors with their load) from
    others, both by joint, from the file beside it. Raises Problem E302."""
    path = sidecar_path(archive)
    try:
        beds = {str(bed["joint"]): bed for bed in read_json(path).get("beds", ())}
        ports = {joint: str(bed["port"]) for joint, bed in beds.items()}
        return ports, {joint: bed.get("bench", {}) for joint, bed in beds.items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError) as reason:
        helps = "`--fresh` drives it again"
        raise Problem(error("E302", f"{path} is damaged: on which beds it was is not known", help=helps)) from reason
