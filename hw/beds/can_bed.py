"""A bed of two drives on a CAN bus, or on a serial line each, `can:BENCH.toml`: one turns the motor under test, the
other loads it.

A drive has a current loop of its own, and is told a torque; or it closes the rate loop, too, and is told a rate. What a
bed's driver is told, for one motor what the deck's bed model sends, and the current of the other, becomes here:

    load   kt_load i
    drive  a torque as it is sent; of a voltage what an armature of kt and resistance takes from it at the rate that was
           read last, kt/R (V - kt w); either at most torque_max. Or a rate, and torque_max is its loop's limit

Limits of voltage, current, their slews, rate and heat are watched here, besides those of the drives; what no host can
do, to stop a shaft whose host is dead, the drives' own watchdogs do, and are made to prove it each time before arming.
Both drives tell of one shaft: an answer counts only where they agree.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from hw import refusals
from hw.bed import About, BedDriver, BedSample, BedState, Capability, Fault, Limits, Scales, real_plant
from hw.beds import can_deck, greeting
from hw.beds.emulated import FINE, FINE_ANGLE, WIDE
from hw.drives import DIALECTS, REFUSED
from hw.drives.arming import FEED, begin_driving, forget, prove_watchdogs, switch_off
from hw.drives.bench_file import SERIAL, TwoDrives
from hw.drives.bus import open_bus
from hw.drives.drive import (
    ASKS,
    FAST,
    NOMINAL,
    OWED,
    CanDrive,
    CanFrame,
    CanLine,
    DriveReading,
    DriveState,
    Talk,
    on_bus,
)
from hw.drives.odrive_lines import on_lines
from hw.drives.side import Side, agree
from hw.ports import Opening, PortKind
from hw.protocol import messages
from met.diagnostic import Diagnostic, Problem, did_you_mean, error
from met.substitution import butterworth
from met.substitution.bed import DriveCommand

LONGEST_SHARE = 0.8
"""Largest share of a period that the frames of an exchange may take on the bus."""

ASKED_SHARE = 0.9
"""Largest share of a period up to which drives are asked what another master would have changed."""

STALE = 0.05
"""Longest time since a drive has said its state, s; an answer that is more than that behind does not count."""

QUIET = 1e-3
"""Time for which pending input is read before drives are asked outside of a run, s."""

DISAGREED = 5
"""Answers in a row in which the drives disagree, after which the bed stops."""


class CanBed(BedDriver):
    """A bed of two drives.

    bench, drives  what the file says, and the host's sides of its drive and load
    open_line      opens the bus;  period: s from one exchange to the next, infinite where none are made
    drive          what it is sent for the drive: a voltage, a torque or a rate
    believed       the rate loop that the deck takes for the drive's; None where it sends no rate
    torque_believed  N m, the largest torque that the deck takes the drive to give; 0 where no deck says it
    of_deck        warnings of what the bench's file says otherwise than the deck
    proved         s after which each drive had stopped by itself when it was last armed; None where it said so only
                   when it was asked
    returned       J that the drives gave back to the supply since the bed was armed, as far as they say so
    """

    def __init__(
        self,
        bench: TwoDrives,
        drives: tuple[CanDrive, CanDrive],
        open_line: Callable[[], CanLine],
        *,
        period: float,
        drive: DriveCommand = "voltage",
        believed: can_deck.BelievedLoop | None = None,
        torque_believed: float = 0.0,
        of_deck: tuple[Diagnostic, ...] = (),
    ) -> None:
        self._kind, self._believed, self._of_deck = drive, believed, of_deck
        self._torque_believed = torque_believed
        self.warnings = of_deck
        self._bench, self._drives, self._open, self.period = bench, drives, open_line, period
        self._line: CanLine | None = None
        self._about: About | None = None
        self._state, self._faults, self._why = BedState.DISARMED, Fault(0), ""
        self.proved: tuple[float | None, ...] = ()
        self.returned, self._heat, self.confirmed = 0.0, 0.0, True

    # Who is there

    def connect(self) -> About:
        self.close()
        self._line = self._open()
        try:
            self._about = self._greet(self._line)
        except BaseException:
            self.close()
            raise
        return self._about

    def _greet(self, line: CanLine) -> About:
        """Greet both drives, and describe the bed by what they say. Raises Problem E402 to E406, E438."""
        self._talk = talk = Talk(line, self._drives)
        for drive_ in self._drives:
            drive_.forget_answers()
        bench, by_rate = self._bench, self._kind == "rate"
        if by_rate and not self._drives[0].takes_rates:
            known = ", ".join(name for name, dialect in DIALECTS.items() if dialect.takes_rates)
            message = f"{self._drives[0].words} of bed `{bench.name}` is told no rate"
            raise Problem(error("E438", message, help=f"dialects that are told rates: {known}"))
        self._drives[0].rates = by_rate
        facts = [drive.greet(talk) for drive in self._drives]
        sides = [Side(drive, drive_facts) for drive, drive_facts in zip(self._drives, facts, strict=True)]
        self._sides = (sides[0], sides[1])
        drive, load = self._sides
        figures = drive.drive.entry.figures
        self._kt, self._resistance, self._kt_load = figures["kt"], figures["resistance"], load.drive.entry.figures["kt"]
        self._most = min(figures["torque_max"], drive.facts.torque_max)
        current = min(load.drive.entry.figures["current_max"], load.facts.torque_max / self._kt_load)
        self._rated = load.drive.entry.figures["current_rated"]
        self._acceleration = (self._most + self._kt_load * current) / bench.shaft["inertia"]
        self._supply_max = min([bench.supply["voltage_max"], *(fact.supply_max for fact in facts if fact.supply_max)])
        by_voltage = self._kind == "voltage"
        count = drive.facts.torque_count * (self._resistance / self._kt if by_voltage else 1.0)
        count = drive.facts.rate_told_count if by_rate else count
        scales = Scales(count or FINE, load.facts.torque_count / self._kt_load or FINE, FINE, FINE_ANGLE, FINE, FINE)
        hz = min(fact.control_hz for fact in facts)
        rate = min(bench.shaft["rate_max"], *(fact.rate_max for fact in facts))
        most = rate if by_rate else figures["voltage_max"] if by_voltage else WIDE * self._most
        slews = 2.0 * most * hz, 2.0 * current * hz
        limits = Limits(most, current, rate, bench.shaft["arming_rate"], *slews, load.drive.entry.figures["heat"])
        capabilities = Capability.ENCODER | (Capability.ARMATURE if by_voltage else Capability(0))
        if not facts[0].braking:
            capabilities |= Capability.COASTS
        versions = "\n".join(
            f"{d.dialect} {d.node} {f.hardware} {f.firmware}" for d, f in zip(self._drives, facts, strict=True)
        )
        firmware = hashlib.sha256(versions.encode()).hexdigest()[:16]
        deadman = max(f.watchdog for f in facts)
        about = About(bench.name, 0, firmware, 0, capabilities, hz, deadman, scales, limits, self._kind)
        if not greeting.DEADMAN[0] <= about.deadman <= greeting.DEADMAN[1] or min(f.watchdog for f in facts) < 0.002:
            helps = "`watchdog` of the bench file: 10 to 20 ms"
            raise Problem(error("E404", f"bed `{about.name}` would stop {1e3 * about.deadman:g} ms late", help=helps))
        coarse = max(fact.rate_count for fact in facts)
        if coarse > bench.shaft["arming_rate"]:
            helps = "a finer unit of velocity in the drive: a shaft that turns would pass for one at rest"
            message = f"bed `{about.name}` has its rate in steps of {coarse:.3g} rad/s, more than `arming_rate`"
            raise Problem(error("E404", message, help=helps))
        self._check_share()
        self._in_force = self._own = greeting.in_force(about)
        self._epoch = line.now()
        self._hold(0, 0, self._epoch)
        self._warmed, self._disagreed = self._epoch, 0
        self._ask_both(about, agreed=False)
        readings = self._readings()
        for side, reading in zip(self._sides, readings, strict=True):
            side.begin(reading, readings[0].time)
        self._filtered = (self._sides[0].rate, 0.0)
        self.remarks = self._remarks()
        self.warnings = (*self._of_deck, *self._of_torque(), *self._of_loop())
        self._state = BedState.STOPPED if self._faults else BedState.DISARMED
        self._latch_failures()
        return about

    def _check_share(self) -> None:
        """Raise Problem E405 where an exchange does not fit into a period; see whether it has room for questions."""
        check = 0.0 if self._bench.bus["interface"] == SERIAL else 2.0 * on_bus(CanFrame(0, bytes(8)))
        self._asks = self._on_bus() + check <= ASKED_SHARE * self.period
        self.unseen = "; ".join(dict.fromkeys((drive if self._asks else CanDrive).unseen for drive in self._drives))
        share = self._on_bus() / self.period
        if share > LONGEST_SHARE:
            message = (
                f"the frames of an exchange take {share:.0%} of its period of {self.period * 1e3:.4g} ms on the bus"
            )
            message += f", and {LONGEST_SHARE:.0%} is the most"
            raise Problem(error("E405", message, help="a lower rate of the servo, or a faster bus"))

    def _on_bus(self) -> float:
        """Longest time that the frames of an exchange take on the bus, s."""
        bus = self._bench.bus
        if bus["interface"] == SERIAL:
            return on_lines(self._exchanged(), bus["baud"])
        speeds = float(bus.get("bitrate", NOMINAL)), float(bus.get("data_bitrate", FAST))
        return sum(on_bus(frame, *speeds) for frame in self._exchanged())

    def _exchanged(self) -> list[CanFrame]:
        """Frames like those of an exchange, both ways."""
        questions = [() if drive.answers_commands else drive.query() for drive in self._drives]
        return [
            frame
            for drive, asks in zip(self._drives, questions, strict=True)
            for frame in (*drive.command(0.0), *asks, *drive.answers())
        ]

    def line_time(self, about: About) -> float:
        return self._on_bus()

    def _remarks(self) -> tuple[tuple[str, str], ...]:
        bus, cut = self._bench.bus, self._bench.shaft["filter"]
        unit, where = ("lines", "there") if bus["interface"] == SERIAL else ("frames", "on the bus at most")
        most = f"{len(self._exchanged())} {unit} an exchange, {1e3 * self._on_bus():.3g} ms {where}"
        filter = f"{cut:g} Hz here, the deck's f_cut" if cut else "none here: the deck's f_cut is the drive's"
        sides = [(side.drive.entry.role, side.words) for side in self._sides]
        if loop := self._sides[0].facts.rate_loop:
            words = (
                f"of rate, the drive's own: {loop[0]:.4g} N*m*s/rad, {loop[1]:.4g} N*m/rad, at most {self._most:g} N*m"
            )
            sides.append(("loop", words))
        return (*sides, ("bus", f"{bus['interface']} {bus['channel']}: {most}"), ("filter", filter))

    def _of_torque(self) -> tuple[Diagnostic, ...]:
        """A warning where the drive's own largest torque is below the file's and below the deck's."""
        own, files = self._sides[0].facts.torque_max, self._bench.drive.figures["torque_max"]
        if min(files, self._torque_believed) <= own * (1.0 + 1e-6):
            return ()
        return (can_deck.torque_warning(self._drives[0].words, own, self._torque_believed),)

    def _of_loop(self) -> tuple[Diagnostic, ...]:
        """A warning where the drive's rate loop differs from the deck's."""
        own = self._sides[0].facts.rate_loop
        if own is None or self._believed is None:
            return ()
        loop_warning = can_deck.loop_warning(self._drives[0].words, *own, self._believed)
        return () if loop_warning is None else (loop_warning,)

    # What a bed does

    def limit(self, limits: Mapping[str, float]) -> None:
        about = self._require_about()
        tighter = greeting.tighter(about, limits)
        if self._kind == "rate" and "rate" in limits:  # its command is a rate, too
            most_counts = greeting.counts(limits["rate"], about.scales.voltage)
            tighter["voltage"] = min(most_counts, tighter.get("voltage", most_counts))
        if self._state != BedState.DISARMED:
            raise self._refused("take tighter limits")
        self._in_force = replace(
            self._in_force, **{name: min(most, getattr(self._own, name)) for name, most in tighter.items()}
        )

    def arm(self) -> BedSample:
        """Arm both drives, once each has shown that its watchdog stops it. Raises Problem E402, E404, E406."""
        about = self._require_about()
        for drive in self._drives:
            drive.forget_answers()
        self._ask_both(about)
        self._follow()
        self._latch_failures()
        if self._state != BedState.DISARMED or not self._slow():
            raise self._refused("arm")
        self._disagreed, self.returned = 0, 0.0
        for drive in self._drives:
            drive.renew(self._talk)
        self.proved = prove_watchdogs(self._talk, about.deadman)
        begin_driving(self._talk)
        self._settle(FEED)
        for drive in self._drives:
            drive.owed.clear()  # questions while the shaft was at rest, without answers yet
        self._state, self.confirmed = BedState.ARMED, False
        self._hold(0, 0, self._talk.line.now())
        return self._sample()

    def exchange(self, voltage: float, current: float) -> BedSample | None:
        """Send both drives their torque (or rate), and take what they answer; None where they did not in time."""
        about, force = self._require_about(), self._in_force
        volts, amperes = greeting.commanded(self, about, force, voltage, current, drive=self._kind)
        scales = about.scales
        talk = self._talk
        now = talk.line.now()
        armed = self._state == BedState.ARMED
        talk.drain()
        if armed:
            ticks = max(1, round((now - self._told_at) * about.tick_hz))
            self._warm(now)
            if now - self._told_at > about.deadman:
                self._stopped(Fault.DEADMAN, "the host was silent")
            elif (
                abs(volts - self._volts) > ticks * force.voltage_slew
                or abs(amperes - self._amperes) > ticks * force.current_slew
            ):
                self._stopped(Fault.SLEW, "")
        frames: list[CanFrame] = []
        if self._state == BedState.ARMED:
            self._hold(volts, amperes, now)
            drive, load = self._drives
            frames += [*load.checks(), *drive.checks()] if self._asks else []
            frames += load.command(self._kt_load * amperes * scales.current)
            frames += drive.command(self._drive_command(volts * scales.voltage))
        answered = self._answers(frames, now)
        if self._state == BedState.ARMED:
            self._watch()
        if not answered and (self._state == BedState.ARMED or not armed):
            return None
        return self._sample(refused=not armed)

    def read(self) -> BedSample:
        about = self._require_about()
        self._silence(about)
        self._ask_both(about)
        self._follow()
        self._silence(about)
        self._latch_failures()
        return self._sample()

    def look(self) -> BedSample | None:
        about = self._require_about()
        self._silence(about)
        self._talk.drain()
        return self._sample() if self._answers([], self._talk.line.now()) else None

    def clear(self) -> BedSample:
        about = self._require_about()
        self._ask_both(about)
        self._follow()
        hot = Fault.HEAT in self._faults and self._heat > about.limits.heat / 2.0
        if self._state == BedState.ARMED or (self._state == BedState.STOPPED and (hot or not self._slow())):
            raise self._refused("clear")
        if self._state == BedState.STOPPED and not forget(self._talk):
            raise self._refused("clear")
        self._talk.forget_other_master()
        self._state, self._faults, self._why = BedState.DISARMED, Fault(0), ""
        return self._sample()

    def account(self) -> tuple[str, ...]:
        why = (f"it stopped itself: {self._why}",) if self._why else ()
        known = [drive.power is not None for drive in self._drives]
        if not any(known):
            return (*why, "neither drive says its power: what went back to the supply is not known")
        whose = (
            "the drives" if all(known) else f"the {self._drives[known.index(True)].entry.role}, which alone says it,"
        )
        return (*why, f"{whose} gave {self.returned:.3g} J back to the supply")

    def rest(self, time: float) -> BedSample:
        self._require_about()
        self.stop()
        self._talk.line.sleep(time)
        self._warm(self._talk.line.now())
        return self.read()

    def preset(self, *, rate: float = 0.0, seed: int = 0, repeat: int = 0) -> BedSample:
        self._require_about()
        raise real_plant()

    def stop(self) -> bool:
        if self._line is None or self._about is None:
            return self.confirmed
        if self._state == BedState.ARMED:
            self._state = BedState.DISARMED
        for _ in range(2):
            try:
                self._hold(0, 0, self._told_at)
                self.confirmed = switch_off(self._talk)
                break
            except Problem:
                self.confirmed = False  # the bus is dead: the drives' watchdogs stop them
        return self.confirmed

    def close(self) -> None:
        self.stop()
        line, self._line, self._about = self._line, None, None
        if line is not None:
            line.close()

    # Answers

    def _answers(self, commands: Sequence[CanFrame], since: float) -> bool:
        """Send commands, ask both drives, and follow what they answer. Returns False where an answer does not come in
        time, or they do not agree.

        Frames have no numbers, and one that is late looks like the answer to a later question. So it is counted what
        each drive was asked and has answered. One that owed nothing before it was asked can only answer this question,
        and did so within a period of it. What the other says is as new as that, whatever it answers, where both agree;
        it then owes what it owed before. Where both owed something, both may be late alike, and neither counts: they
        are asked nothing then, but by commands that are answered, until what they owe has come or never will.
        """
        talk = self._talk
        owed = []
        for drive in self._drives:
            drive.owes(since)
            owed.append(tuple(drive.owed))
            drive.reading = None
        some_even, all_even = not all(owed), not any(owed)
        drives = [d for d in self._drives if some_even and not (commands and d.answers_commands)]
        talk.send([*commands, *dict.fromkeys(frame for d in drives for frame in d.query())])  # one SYNC is to both
        if not some_even:
            self._settle(min(self.patience, self.period))
            return False

        def settled() -> bool:
            return self._answered(since) and (all_even or self._agree())

        talk.pump(since + self.patience, settled)
        if not self._answered(since):
            return False
        if commands and max(reading.time for reading in self._readings()) > since + self.period:
            return False
        stale = talk.line.now() - min(drive.stated for drive in self._drives) > STALE
        if stale or not self._agree():
            self._disagreed += 1
            if self._disagreed < DISAGREED or self._state != BedState.ARMED:
                return False
            self._stopped(Fault.DISAGREEMENT, "")
            return True
        self._disagreed = 0
        for drive, before in zip(self._drives, owed, strict=True):
            if len(drive.owed) == len(before):  # answered once, and that to this question
                drive.owed.clear()
                drive.owed.extend(before)
        self._follow()
        return True

    def _settle(self, longest: float) -> None:
        """Read until neither drive owes an answer, or for the longest time, s."""
        line = self._talk.line
        self._talk.pump(line.now() + longest, lambda: not any(drive.owes(line.now()) for drive in self._drives))

    def _agree(self) -> bool:
        return agree(self._sides, self._readings(), self._acceleration)

    def _readings(self) -> tuple[DriveReading, DriveReading]:
        first, other = (drive.reading for drive in self._drives)
        assert first is not None and other is not None
        return first, other

    def _ask_both(self, about: About, agreed: bool = True) -> None:
        """Ask both drives until both have answered and agree. Raises Problem E402 (no answer), E406 (no agreement)."""
        talk = self._talk
        asks = tuple(dict.fromkeys(frame for drive in self._drives for frame in drive.query()))
        for _ in range(ASKS):
            talk.pump(talk.line.now() + QUIET)
            self._settle(OWED)
            since = talk.line.now()
            if not talk.ask(asks, partial(self._answered, since)):
                late = next(d for d in self._drives if d.reading is None or d.reading.time <= since)
                raise refusals.silent(about.name, f"of {late.words} what its angle is")
            if not agreed or self._agree():
                return
        what = Fault.DISAGREEMENT
        raise Problem(error("E406", f"bed `{about.name}`: {refusals.words(what)}", help=refusals.remedies(what)))

    def _answered(self, since: float) -> bool:
        """True where both drives have answered since a time, s."""
        return all(drive.reading is not None and drive.reading.time >= since for drive in self._drives)

    def _follow(self) -> None:
        """Keep the last answers of both drives: angle, rate, and the rate after the filter."""
        side = self._sides[0]
        before, time = side.rate, side.time
        for motor_side, reading in zip(self._sides, self._readings(), strict=True):
            motor_side.follow(reading)
        cut, passed = self._bench.shaft["filter"], side.time - time
        if cut and passed > 0.0:
            filter = butterworth.over(cut, passed)
            y, slope = butterworth.along_line(filter, self._filtered, before, side.rate)
            self._filtered = float(y), float(slope)
        elif not cut:
            self._filtered = side.rate, 0.0

    def _watch(self) -> None:
        """Stop where a drive stopped, another master commands one, or the supply's voltage or the rate is too high."""
        if other := self._talk.other_master:
            self._stopped(Fault.OTHER_MASTER, other)
            return
        for drive in self._drives:
            if not drive.sound:
                words = f"{drive.words}: {drive.errors or 'it drives no more, and tells no error'}"
                self._stopped(Fault.DEADMAN if drive.starved else Fault.DRIVE, words)
                return
            if drive.supply is not None and drive.supply > self._supply_max:
                self._stopped(Fault.SUPPLY, f"{drive.supply:.3g} V")
                return
        if abs(self._rate()) > self._in_force.rate:
            self._stopped(Fault.RATE, "")

    def _silence(self, about: About) -> None:
        """Stop where no command has come for the deadman's time: reading must not keep the drives alive."""
        if self._state == BedState.ARMED and self._talk.line.now() - self._told_at > about.deadman:
            self._stopped(Fault.DEADMAN, "the host was silent")

    # The state

    def _require_about(self) -> About:
        if self._about is None:
            raise refusals.not_connected(str(self._bench.bus["channel"]))
        return self._about

    def _drive_command(self, sent: float) -> float:
        """The command for the drive under test: N m, as sent or of an armature at the voltage sent; or rad/s."""
        if self._kind == "rate":
            return sent
        if self._kind == "torque":
            torque = sent
        else:
            torque = self._kt / self._resistance * (sent - self._kt * self._sides[0].rate)
        return min(max(torque, -self._most), self._most)

    def _hold(self, volts: int, amperes: int, time: float) -> None:
        self._volts, self._amperes, self._told_at = volts, amperes, time

    def _warm(self, now: float) -> None:
        """Update the load's heat, A^2 s, and stop where it is too much; add up the energy that drives returned."""
        about = self._require_about()
        passed, self._warmed = now - self._warmed, now
        held = self._amperes * about.scales.current
        self._heat = max(0.0, self._heat + (held * held - self._rated * self._rated) * passed)
        self.returned += sum(max(0.0, -(drive.power or 0.0)) for drive in self._drives) * passed
        if self._heat > about.limits.heat and self._state == BedState.ARMED:
            self._stopped(Fault.HEAT, "")

    def _latch(self, fault: Fault, why: str) -> None:
        self._state, self._faults = BedState.STOPPED, self._faults | fault
        self._why = self._why or why

    def _latch_failures(self) -> None:
        """Latch that a drive has failed or another master commands it, where the bed is disarmed."""
        if self._state == BedState.DISARMED and (other := self._talk.other_master):
            self._latch(Fault.OTHER_MASTER, other)
        for drive in self._drives:
            if drive.state == DriveState.FAILED and self._state == BedState.DISARMED:
                self._latch(Fault.DEADMAN if drive.starved else Fault.DRIVE, f"{drive.words}: {drive.errors}")

    def _stopped(self, fault: Fault, why: str) -> None:
        self._latch(fault, why)
        self._hold(0, 0, self._told_at)
        self.confirmed = switch_off(self._talk, halt=True)

    def _rate(self) -> int:
        """The shaft's rate in counts, behind the filter; the largest where it has none."""
        counts = self._filtered[0] / FINE
        return round(counts) if abs(counts) < messages.MOST else messages.MOST

    def _slow(self) -> bool:
        return abs(self._rate()) <= greeting.counts(self._require_about().limits.arming_rate, FINE)

    def _refused(self, what: str) -> Problem:
        problem = refusals.refused(self._require_about(), what, self._sample(refused=True))
        if not self._why:
            return problem
        only = problem.diagnostics[0]
        return Problem(replace(only, help=(self._why, *only.help)))

    def _sample(self, *, refused: bool = False) -> BedSample:
        about, side = self._require_about(), self._sides[0]
        angle = round(side.angle / FINE_ANGLE) * FINE_ANGLE
        tick = max(0, int((side.time - self._epoch) * about.tick_hz))
        return BedSample(self._state, True, self._faults, refused, tick, self._rate() * FINE, angle)


def _opened_port(opening: Opening) -> CanBed:
    """The bed of `--port can:BENCH.toml`, its line still closed. Raises Problem E409, E446."""
    if opening.port.transcript is not None:
        helps = "records are kept of every exchange; `candump` keeps what goes over a bus"
        raise Problem(error("E409", "no transcript is kept of a CAN bus", help=helps))
    path = opening.port.address
    bench = can_deck.bench_at(path)
    drives = []
    for entry in (bench.drive, bench.load):
        if why := REFUSED.get(entry.dialect):
            raise Problem(error("E446", f"{path}: {why[0]}", help=why[1:]))
        dialect = DIALECTS.get(entry.dialect)
        if dialect is None:
            known = (*did_you_mean(entry.dialect, DIALECTS), f"dialects: {', '.join(DIALECTS)}")
            raise Problem(error("E446", f"{path}: no dialect `{entry.dialect}`", help=known))
        drives.append(dialect(entry))
    drive = opening.drive or "voltage"
    return CanBed(
        bench,
        (drives[0], drives[1]),
        lambda: open_bus(bench.bus),
        period=opening.period,
        drive=drive,
        believed=can_deck.believed_loop(opening),
        torque_believed=0.0 if opening.experiment is None else can_deck.believed_torque(opening),
        of_deck=tuple(can_deck.warnings(bench, path, opening)),
    )


PORT = PortKind(
    scheme="can",
    address="BENCH.toml",
    doc=f"Two drives on a CAN bus or on serial lines, as the file says; their dialects: {', '.join(DIALECTS)}.",
    open=_opened_port,
    check=can_deck.check_deck,
    bench=lambda address: can_deck.bench_at(address).identity,
)
