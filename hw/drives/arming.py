"""Both drives of a bench made to drive, seen to stop by themselves, and switched off."""

from __future__ import annotations

from hw.drives.drive import DriveState, Talk
from met.diagnostic import Problem, error

TO_ARM, TO_IDLE = 1.0, 0.1
"""Longest time for a drive to begin to drive, and to stop on command, s."""

FEED = 0.002
"""s from one command to the next while drives begin to drive."""


def begin_driving(talk: Talk) -> None:
    """Let both drives drive with nothing commanded. Raises Problem E406 where one does not; both are off then."""
    for drive in reversed(talk.drives):
        talk.send(drive.armed())
    end = talk.line.now() + TO_ARM
    while not talk.pump(talk.line.now() + FEED, lambda: all(d.sound for d in talk.drives)):
        wrong = [d for d in talk.drives if d.state == DriveState.DRIVING and d.errors]
        if wrong or talk.line.now() > end:
            late = next(d for d in (*wrong, *talk.drives) if not d.sound)
            message = f"{late.words} does not begin to drive: {late.errors or 'it does not say why'}"
            _give_up(talk)
            raise Problem(error("E406", message, help="is it calibrated? its maker's tool says what it lacks"))
        for drive in talk.drives:
            talk.send(drive.command(0.0))


def prove_watchdogs(talk: Talk, deadman: float) -> tuple[float | None, ...]:
    """Let both drives run with a zero command, leave them alone, and check that each stops by its watchdog, within
    deadman (s) and half as much again. Returns the time after which each reported it, s; None for one that reports it
    only when asked. Raises Problem E406 where one does not stop; both are off then."""
    begin_driving(talk)
    began = talk.line.now()
    ended: dict[int, float] = {}

    def all_stopped() -> bool:
        for drive in talk.drives:
            if drive.state != DriveState.DRIVING and drive.node not in ended:
                ended[drive.node] = talk.line.now() - began
        return len(ended) == len(talk.drives)

    quiet = 1.5 * deadman + 0.02
    if not talk.pump(began + quiet, all_stopped):
        late = [drive for drive in talk.drives if drive.node not in ended]
        asks = [frame for drive in late for frame in drive.query()]
        talk.ask(asks, lambda: all(drive.stated > began + quiet for drive in late))
    for drive in talk.drives:
        if drive.state == DriveState.DRIVING:
            _give_up(talk)
            message = f"{drive.words} still drives {1e3 * quiet:.3g} ms after the last command, without torque, and "
            message += f"its watchdog was to stop it after {1e3 * deadman:.3g} ms"
            helps = (
                "it is not armed; look whether its watchdog is switched on",
                "nothing else stops it without a host",
                "another program or computer that commands it feeds its watchdog, too",
            )
            raise Problem(error("E406", message, help=helps))
        if not drive.starved:
            message = f"{drive.words} stopped while it was armed without torque: "
            message += drive.errors or "it does not say why"
            _give_up(talk)
            raise Problem(error("E406", message, help="its maker's tool says what that means"))
    if not forget(talk):
        late = [d for d in talk.drives if d.state != DriveState.IDLE]
        message = f"{late[0].words} does not forget that its watchdog stopped it"
        raise Problem(error("E406", message, help="switch it off and on"))
    return tuple(ended.get(drive.node) for drive in talk.drives)


def _give_up(talk: Talk) -> None:
    """Switch both outputs off, and clear the watchdog error of a drive that has stopped by it."""
    switch_off(talk)
    if all(drive.starved for drive in talk.drives if drive.state == DriveState.FAILED):
        forget(talk)


def forget(talk: Talk) -> bool:
    """Let both drives forget their errors. Returns whether they did."""
    for _ in range(3):
        for drive in talk.drives:
            if drive.state != DriveState.IDLE:
                talk.send(drive.cleared())
                talk.send(drive.query())
        if talk.pump(talk.line.now() + TO_IDLE, lambda: all(d.state == DriveState.IDLE for d in talk.drives)):
            return True
    return False


def switch_off(talk: Talk, *, halt: bool = False) -> bool:
    """Switch both outputs off, the load's first. halt: so that the drives remember it. Returns whether both say that
    they are off."""
    now = talk.line.now()
    for _ in range(5):
        for drive in reversed(talk.drives):
            talk.send(drive.halted() if halt else drive.idle())
            talk.send(drive.query())
        if talk.pump(
            talk.line.now() + TO_IDLE / 5,
            lambda: all(d.state != DriveState.DRIVING and d.stated > now for d in talk.drives),
        ):
            return True
    return False
