"""The errors of a bed that cannot be reached or says no: E400 to E409, each with its remedy."""

from __future__ import annotations

from collections.abc import Sequence

from hw.bed import About, BedDriver, BedSample, BedState, Fault, InterlockReason
from hw.boards.build import Uncountable
from hw.protocol.frames import Decoder
from hw.protocol.messages import VERSION
from met.diagnostic import Problem, error

_FAULTS = {
    Fault.DEADMAN: (
        "no new command came within the deadman's time",
        "the computer or the line was late: leave the computer less to do, or exchange at a lower rate",
    ),
    Fault.RANGE: (
        "a command was beyond a limit",
        "limits that the host knows are checked before: it has others than the bed; greet the bed anew",
    ),
    Fault.SLEW: (
        "a command changed faster than a limit",
        "command it more smoothly, or give the bed a wider limit of slew where it can bear it",
    ),
    Fault.RATE: (
        "the shaft was faster than its limit",
        "look whether the load drives the shaft; lower the rate that is asked for",
    ),
    Fault.CURRENT: ("a current was beyond its limit", "look for a short circuit or a shaft that is held"),
    Fault.HEAT: ("the load motor was loaded for too long", "let it cool, and load it less, or for less time"),
    Fault.TACHOMETER_DEAD: (
        "torque did not change the measured rate",
        "look whether the tachometer is connected, and whether the shaft is free",
    ),
    Fault.TACHOMETER_REVERSED: (
        "the measured rate changed against the torque",
        "exchange the two wires of the tachometer, or of the motor",
    ),
    Fault.NOISE: (
        "too many frames did not decode",
        "look at the line's cable, its shield and its ground; try a lower baud rate",
    ),
    Fault.WATCHDOG: (
        "it was reset by its watchdog",
        "its firmware hung or its supply dipped: find out before going on",
    ),
    Fault.DRIVE: ("a drive stopped itself", "its maker's tool says why: a current, a temperature, its encoder"),
    Fault.SUPPLY: (
        "the supply's voltage was above its limit",
        "what a motor gives back has to go somewhere: a brake resistor, or capacitors that take it",
    ),
    Fault.DISAGREEMENT: (
        "the two drives do not agree about the shaft",
        "look whether the coupling slips, and whether one of them counts the other way round: `reversed`",
    ),
    Fault.OTHER_MASTER: (
        "another program or computer commands it",
        "find and end it: another run, a maker's tool on another port of a drive, a controller on the bus",
    ),
    Fault.INTERLOCK: ("its interlock stopped it", "`met bed probe` says by which of its inputs"),
}

_REASONS = {
    InterlockReason.STOP: ("the emergency stop is pressed, or its wire is off", "find out why, then release it"),
    InterlockReason.READY: ("an amplifier is not ready", "read what the amplifier shows; is it switched on?"),
    InterlockReason.READ_BACK: (
        "the amplifiers are not enabled as they should be",
        "look at the enable line's relay: a contact that is welded, or a wire that is off",
    ),
    InterlockReason.KEY: ("nobody has turned its key since it last stopped", "turn the key off, then on, at the bed"),
    InterlockReason.CONVERTER: (
        "its converter does not read its reference as what it is",
        "look at the converter's supply and reference",
    ),
    InterlockReason.DRIVE_HEAT: ("the drive motor was loaded for too long", "let it cool, and load it less"),
    InterlockReason.TEMPERATURE: ("the drive motor is too warm, or its thermistor is off", "let it cool; see its wire"),
    InterlockReason.BUS: ("the supply's voltage is too high or too low", "look at the supply and its brake resistor"),
    InterlockReason.ANGLE: ("the shaft is beyond a limit of its angle", "turn it back by hand, its brake released"),
    InterlockReason.ENCODER: ("encoder and tachometer do not agree", "look at the wires of both, and their scales"),
    InterlockReason.LOAD: ("the load's current is not what it is told", "look at its amplifier, wires and sensor"),
    InterlockReason.TICK: ("its ticks do not come in time", "its clock is wrong, or it hung: change the board"),
    InterlockReason.MAIN: ("its main program stands still", "its processor hung: switch it off and on"),
}


def words(faults: Fault) -> str:
    """Faults in words."""
    return "; ".join(_FAULTS[fault][0] for fault in Fault if fault in faults)


def remedies(faults: Fault) -> list[str]:
    """The remedy for each of these faults, in words."""
    return [_FAULTS[fault][1] for fault in Fault if fault in faults]


def interlocked(reasons: InterlockReason | None) -> list[tuple[str, str]]:
    """The reasons of an interlock in words, each with its remedy."""
    return [_REASONS[reason] for reason in InterlockReason if reasons is not None and reason in reasons]


def refused(about: About, what: str, sample: BedSample) -> Problem:
    """The error for a bed that did not carry out a request (`arm`, `clear` ...), from its answer."""
    latched = sample.faults & ~Fault.WATCHDOG
    slow = about.limits.arming_rate
    locked = interlocked(sample.interlock)
    if not sample.greeted:
        why, helps = "it was reset since it was greeted", ["look at its supply, then begin anew"]
    elif sample.state == BedState.STOPPED and latched and what != "clear":
        why = f"it stopped itself: {'; '.join([words(latched), *(lock for lock, _ in locked)])}"
        helps = [*remedies(latched & ~Fault.INTERLOCK), *(remedy for _, remedy in locked)]
    elif abs(sample.rate) > slow:
        why = f"its shaft turns at {sample.rate:.3g} rad/s, and {slow:.3g} rad/s is the most for that"
        helps = ["wait until it has come to rest; a shaft that does not is driven by something"]
    elif sample.state == BedState.ARMED:
        why, helps = "it is armed", ["stop it first"]
    elif locked:
        why, helps = "; ".join(lock for lock, _ in locked), [remedy for _, remedy in locked]
    elif Fault.HEAT in latched:
        why, helps = "the load motor has not cooled down to half of its I2t", ["wait, or switch its amplifier off"]
    else:
        why, helps = "it does not say why", ["switch it off and on, and begin anew"]
    return Problem(error("E406", f"bed `{about.name}` does not {what}: {why}", help=helps))


def latched(about: About, faults: Fault, port: str) -> Problem:
    """The error for a bed that had stopped itself before it was greeted, and whose faults are still latched."""
    message = f"bed `{about.name}` has stopped itself, and is to be cleared first: {words(faults & ~Fault.WATCHDOG)}"
    own = f"then `met bed clear --port {port}`; `met bed run --clear` does so before each case"
    return Problem(error("E406", message, help=[*remedies(faults & ~Fault.WATCHDOG), own]))


def check_stopped(beds: Sequence[BedDriver], abouts: Sequence[About], why: str) -> None:
    """Raise Problem where a bed that was driven has not confirmed that it is disarmed. why: the reason of an early
    end."""
    unsure = [about.name for bed, about in zip(beds, abouts, strict=True) if not bed.stop()]
    if unsure:
        early = f"{why}; " if why else ""
        message = f"{early}bed `{unsure[0]}` does not confirm that it stopped"
        helps = ("cut its amplifiers' power: press the emergency stop", "its deadman has stopped it, if that works")
        raise Problem(error("E406", message, help=helps))


def not_connected(name: str) -> Problem:
    """The error for a bed to which there is no line."""
    helps = "connect to it first; a line that was lost is not taken up again by itself"
    return Problem(error("E401", f"there is no line to a bed on {name}", help=helps))


def other_version(version: int) -> Problem:
    """The error for a bed that speaks another version of the protocol."""
    message = f"the bed speaks version {version} of the protocol, and this MET {VERSION}"
    helps = "put the firmware of this version of MET on it, or take the MET that its firmware came with"
    return Problem(error("E403", message, help=helps))


def no_greeting(name: str, sent: bytes, came: bytes) -> Problem:
    """The error for a bed that does not answer HELLO: the question, and the bytes that came in place of an answer."""
    message = f"nobody answers HELLO on {name}"
    questions, decoder = set(sent.split(b"\0")) - {b""}, Decoder()
    ours = sum(frame in questions for frame in came.split(b"\0"))
    frames = len(decoder.feed(came)) - ours
    if not came:
        helps = ["is the bed switched on, and this the line that it is on?", "does it expect this baud rate?"]
    elif ours:
        message += f": what comes back is what was sent, {ours} of {len(questions)} frames"
        helps = ["take away a loop-back plug, or a bridge between its two wires", "switch a modem's echo off"]
    elif frames:
        message += f": {frames} frame{'s' * (frames > 1)} came, and no answer among them"
        helps = ["is another computer on the same line?", "is it the firmware of a bed, of this version?"]
    else:
        message += f": {len(came):,} bytes came, and no frame that decodes"
        helps = ["give the baud rate that the bed has, `--baud`", "is another device on this line?"]
    return Problem(error("E402", message, help=helps))


def silent(name: str, question: str) -> Problem:
    """The error for a question without an answer: one that was repeated, or a STEP, which is sent once."""
    message = f"bed `{name}` does not answer {question}"
    return Problem(error("E402", message, help="it was there before: look at its supply and at the line"))


def no_command(about: About, what: str, value: float, unit: str, most: float) -> Problem:
    """The error for a voltage or a current that is beyond a limit, and so is not sent."""
    reason = "no finite number" if value - value != 0.0 else f"beyond the limit of {most:.6g} {unit}"
    message = f"{what} of {value:.6g} {unit} for bed `{about.name}` is {reason}; the bed was stopped"
    return Problem(error("E408", message, help="the simulation diverges, or asks more than the bed may give"))


def uncountable(joint: str, reason: Uncountable) -> Problem:
    """The error for a deck's bed whose numbers the firmware cannot count."""
    message = f"the bed of joint `{joint}` cannot be one of firmware: {reason}"
    helps = (f"give the deck's bed {reason.remedy}", "`--port emulated` has it as it is")
    return Problem(error("E404", message, help=helps))
