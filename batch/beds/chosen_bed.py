"""The bed that `--port` chooses: a port, and the deck's joint where the bed is simulated."""

from __future__ import annotations

import os
from collections.abc import Sequence

from batch.campaigns.choosing import experiments_named, read_plan
from hw.drivers import check_model, kind_of
from met.diagnostic import Problem, error
from met.frozen import frozen
from met.plan import Experiment, Plan


@frozen
class ChosenBed:
    """The bed that a user chose. port: without its joint;  experiment: None where no deck was given;  joint: of the
    experiment, on that bed"""

    port: str
    experiment: Experiment | None = None
    joint: str = ""

    @property
    def simulated(self) -> Experiment | None:
        """The experiment whose bed the port simulates; None where it does not."""
        return self.experiment if kind_of(self.port).simulated else None


def on_beds(plan: Plan, names: Sequence[str] | None) -> list[Experiment]:
    """The experiments of a plan, all or those of these names, that have motors on beds. Raises Problem E310, E333."""
    experiments = [experiment for experiment in experiments_named(plan, names) if experiment.structure.substitutions]
    if not experiments:
        helps = ["a run says so: `substitute JOINT { }`", "name the run or sweep that does, if it is another one"]
        raise Problem(error("E333", "no joint is on a bed here", help=helps))
    return experiments


def chosen_bed(
    word: str,
    source: str | None,
    names: tuple[str, ...],
    *,
    defines: tuple[str, ...] = (),
    include_dirs: tuple[str, ...] = (),
    settings: tuple[str, ...] = (),
    quiet: bool = False,
) -> ChosenBed:
    """The bed of `PORT`, or of `JOINT=PORT` with a deck, whose first case is used. Raises Problem."""
    bed = _chosen_bed(
        word,
        None
        if source is None
        else read_plan(source, names, defines=defines, include_dirs=include_dirs, settings=settings, quiet=quiet),
        names,
    )
    if kind_of(bed.port).replays:
        helps = "give the line that it was made on; `met bed run --port FILE` replays it"
        raise Problem(error("E428", f"{bed.port} is a transcript, and no bed that could be asked", help=helps))
    if bed.experiment is not None:
        check_model(bed.port, bed.experiment, bed.joint)
    return bed


def _chosen_bed(word: str, plan: Plan | None, names: tuple[str, ...]) -> ChosenBed:
    """The bed (a motor under test with its load) that a `--port` names, and the deck's joint that it stands for, if
    there is a deck. Raises Problem E418 where it is unclear of which joint."""
    joint, port = split(word)
    if plan is None:
        return ChosenBed(port)
    experiment = on_beds(plan, names or None)[0]
    joints = [substitution.joint for substitution in experiment.structure.substitutions]
    if joint in joints:
        return ChosenBed(port, experiment, joint)
    if joint:
        raise on_none(word, joint, joints)
    if len(joints) > 1:
        joint_ports = " or ".join(f"`--port {joint}={word}`" for joint in joints)
        raise Problem(error("E418", f"port `{word}`: of which joint?", help=f"say {joint_ports}"))
    return ChosenBed(port, experiment, joints[0])


def split(word: str) -> tuple[str, str]:
    """Joint and port of `JOINT=PORT`; "" and the port of `PORT`, which may have a `=` in its path or address."""
    joint, equals, port = word.partition("=")
    return (joint, port) if equals and joint.isidentifier() and not os.path.exists(word) else ("", word)


def on_none(word: str, joint: str, joints: Sequence[str]) -> Problem:
    """The error for a port of a joint that is not on a bed."""
    on = ", ".join(f"`{joint}`" for joint in joints)
    return Problem(error("E418", f"port `{word}`: joint `{joint}` is on no bed here", help=f"on a bed here: {on}"))
