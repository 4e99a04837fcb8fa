"""`met bed run`: a deck's run or sweep on motor beds, into an archive like any other."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from batch.beds.executor import OnBeds, Ports
from batch.campaign import Campaign, Wires, prepare
from batch.choosing import experiments_named
from batch.performing import Performed, perform
from batch.running import read_plan
from hw.case import pace_of
from hw.ports import in_lock_step
from met.diagnostic import Problem, error
from met.margin import margins
from met.plan import Experiment, Plan


def ports_of(given: Sequence[str], experiments: Sequence[Experiment]) -> dict[str, str]:
    """By joint, of words `PORT` or `JOINT=PORT`. Raises Problem E418."""
    joints = list(dict.fromkeys(each.joint for one in experiments for each in one.structure.substitutions))
    found: dict[str, str] = {}
    for word in given:
        joint, equals, port = word.partition("=")
        if not equals or joint not in joints:
            joint, port = (joints[0] if len(joints) == 1 else ""), word
        if not joint:
            own = " ".join(f"--port {each}=..." for each in joints)
            raise Problem(error("E418", f"port `{word}`: of which joint?", help=f"each has its own: `{own}`"))
        if joint in found:
            raise Problem(error("E418", f"joint `{joint}` has two ports", help="leave one of the two out"))
        found[joint] = port
    missing = [joint for joint in joints if joint not in found]
    if missing:
        helps = "`--port JOINT=PORT`: a serial line, `emulated`, `firmware`, `qemu`, or a transcript"
        raise Problem(error("E418", f"no port for the bed of joint `{missing[0]}`", help=helps))
    return found


def campaign_of(
    plan: Plan, names: Sequence[str] | None, ports: Sequence[str], *, lock_step: bool = False,
    output: str | Path | None = None, cases: Sequence[str] | None = None,
) -> tuple[Campaign, dict[str, str], bool]:  # fmt: skip
    """What will be run; by joint its ports; whether the beds have no time of their own. Raises Problem."""
    experiments = experiments_named(plan, names)
    asked = [each for each in experiments if each.structure.substitutions]
    if not asked:
        helps = ["a run says so: `substitute JOINT { }`", "name the run or sweep that does, if it is another one"]
        raise Problem(error("E333", "no joint is on a bed here", help=helps))
    by_joint = ports_of(ports, asked)
    steps = {in_lock_step(port, lock_step) for port in by_joint.values()}
    if len(steps) > 1:
        helps = "give all beds ports of one kind"
        raise Problem(error("E414", "some of the beds have a time of their own, and some have none", help=helps))
    [stepped] = steps
    late = max(pace_of(each).late(stepped) for each in asked)
    found = prepare(
        plan, output=output, experiments=names, cases=cases, histories="all", wires=Wires(late)
    )
    return found, by_joint, stepped


def check_margins(campaign: Campaign, *, force: bool) -> list[str]:
    """What is said of stability before a bed is armed. Raises Problem E419 where a law has no margin."""
    said = []
    for part in campaign.parts:
        for case in margins(part.experiment):
            for one in case:
                if one.case not in part.rows:
                    continue
                limit = f"{one.limit:.3g}" if one.limit is not None else f"more than {one.searched:.3g}"
                text = f"{one.joint}: r = {one.together:.3g}, stable to {limit} with {one.law} at {one.rate_hz:g} Hz"
                if not one.stable and not force:
                    helps = ("`met margin` says what would be; a lighter arm, a faster servo or another law",
                             "`--force` arms it all the same")  # fmt: skip
                    raise Problem(error("E419", f"case #{one.case}, {text}: it would not be stable", help=helps))
                said.append(text)
    return list(dict.fromkeys(said))


def run(campaign: Campaign, executor: OnBeds, *, fresh: bool = False) -> Performed:
    """Drive it into its archive."""
    return perform(campaign, executor=executor, fresh=fresh)


__all__ = ["OnBeds", "Ports", "campaign_of", "check_margins", "ports_of", "read_plan", "run"]
