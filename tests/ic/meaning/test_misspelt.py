"""A misspelt key is told, with the one that was meant, and not also that this one is missing. Whole messages.

Of what models need: tests/met/declarations/test_defaults.py.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.ic.small_decks import ARM, RUN, SERVO, changed, check, messages

OF_RUN = "a run has: arm, base, servos, initial, environment, rates, integrator, duration, record, tolerances, seed"
OF_JOINT = "it has: parent, child, at, rpy, axis, dh, q_min, q_max, qd_max, tau_max, follows, ratio, offset"
OF_LINK = "it has: mass, shape, com, inertia, mesh, lumped"
OF_SERVO = (
    "it has: ratio, kp, ki, v_max, k_position, resistance, kt, tau_max, j_m, f_c, f_v, friction, model, command, rate"
)
MODELS = "servo models: cascade, compliant_gearbox, external, ideal, locked, passive, rigid_gearbox"
OF_PAYLOAD = "it has: mass, com, inertia, shape, on, at, rpy, grapple, release, position, attitude, velocity, rate"
RATES = "rates: dynamics, servos, record, base"

POSITION = changed(SERVO, ("command = rate(0.1 rad/s)", "k_position = 5 1/s; command = position(0.1 rad)"))
FOLLOWED = changed(SERVO, ("0.1 rad/s)", 'trajectory(file = "moves.csv"))'))
METRIC = changed(RUN, ("duration", "metric m = max { of = hinge.qd; }\n    duration"))
PAYLOAD = changed(RUN, ("duration", "payload box { on = bar; mass = 1 kg; inertia = [1, 1, 1] kg*m^2; }\n    duration"))
TABLE = changed(
    RUN, ("duration", 'environment { push = wrench_table { link = bar; file = "loads.csv"; } }\n    duration')
)
BED = changed(
    RUN, ("[q]", "[hinge.servo.voltage]"), ("duration", "substitute hinge { law = torque_balance; }\n    duration")
)
GUIDED = changed(SERVO, ("command = rate(0.1 rad/s)", "k_position = 5 1/s; command = position(home)"))
GUIDE = changed(
    RUN,
    (
        "duration",
        "guide home = together { hinge.to = 1 rad; max_rate = 1 rad/s; max_acceleration = 1 rad/s^2; }\n    duration",
    ),
)


@pytest.mark.slow
@pytest.mark.parametrize(("deck", "written", "misspelt", "code", "message", "remedies"), [
    ((ARM, SERVO, RUN), "mass =", "mas =", "D141", "link `bar` has no `mas`", (OF_LINK,)),
    ((ARM, SERVO, RUN), "shape =", "shap =", "D141", "link `bar` has no `shap`", (OF_LINK,)),
    ((ARM, SERVO, RUN), "length =", "lenght =", "D141", "the rod of link `bar` has no `lenght`",
     ("it has: length, along",)),
    ((ARM, SERVO, RUN), "parent =", "parnt =", "D141", "joint `hinge` has no `parnt`", (OF_JOINT,)),
    ((ARM, SERVO, RUN), "child =", "chlid =", "D141", "joint `hinge` has no `chlid`", (OF_JOINT,)),
    ((ARM, SERVO, RUN), "axis =", "axsi =", "D141", "joint `hinge` has no `axsi`", (OF_JOINT,)),
    ((ARM, SERVO, RUN), "model =", "modl =", "D141", "servo `drive` has no `modl`", (MODELS,)),
    ((ARM, SERVO, RUN), "tau_max =", "tua_max =", "D141", "servo `drive` has no `tua_max`", (OF_SERVO,)),
    ((ARM, SERVO, RUN), "command =", "comand =", "D141", "servo `drive` has no `comand`", (OF_SERVO,)),
    ((ARM, POSITION, RUN), "k_position =", "k_positon =", "D141", "servo `drive` has no `k_positon`", (OF_SERVO,)),
    ((ARM, FOLLOWED, RUN), "file =", "fiel =", "D141", "`trajectory` has no `fiel`",
     ("it has: file, column, interpolation, begin",)),
    ((ARM, SERVO, RUN), "arm =", "amr =", "D109", "a run has no `amr`", (OF_RUN,)),
    ((ARM, SERVO, RUN), "duration =", "duratoin =", "D109", "a run has no `duratoin`", (OF_RUN,)),
    ((ARM, SERVO, RUN), "record = [", "recrd = [", "D109", "a run has no `recrd`", (OF_RUN,)),
    ((ARM, SERVO, RUN), "rates {", "rats {", "D109", "nothing named `rats` in run `hold` to change",
     ("`metric rats = ...` would add a metric",)),
    ((ARM, SERVO, BED), "servos {", "sevros {", "D109", "nothing named `sevros` in run `hold` to change",
     ("`metric sevros = ...` would add a metric",)),
    ((ARM, SERVO, RUN), "dynamics =", "dynamic =", "D116", "no rate `dynamic`", (RATES,)),
    ((ARM, SERVO, RUN), "servos = 1", "servo = 1", "D116", "no rate `servo`", (RATES,)),
    ((ARM, SERVO, BED), "hinge = drive", "hing = drive", "D144", "no joint `hing` in arm `swing`", ("joints: hinge",)),
    ((ARM, SERVO, METRIC), "of = hinge", "off = hinge", "D141", "metric `m` has no `off`", ("it has: of, after, within",)),
    ((ARM, SERVO, PAYLOAD), "on = bar", "onn = bar", "D141", "payload `box` has no `onn`", (OF_PAYLOAD,)),
    ((ARM, SERVO, PAYLOAD), "inertia =", "inerta =", "D141", "payload `box` has no `inerta`",
     (OF_PAYLOAD,)),
    ((ARM, SERVO, TABLE), "file =", "fiel =", "D141", "environment `push` has no `fiel`",
     ("it has: link, point, axes, begin, times, force_x, force_y, force_z, moment_x, moment_y, moment_z, file",)),
    ((ARM, GUIDED, GUIDE), "hinge.to =", "hinge.too =", "D141", "guide `home` has no `hinge.too`",
     ("it has: begin, to, max_rate, max_acceleration, hinge.to, hinge.max_rate, hinge.max_acceleration",)),
])  # fmt: skip
def test_a_misspelt_key_is_told_once(
    deck: tuple[str, ...],
    written: str,
    misspelt: str,
    code: str,
    message: str,
    remedies: tuple[str, ...],
    tmp_path: Path,
) -> None:
    (tmp_path / "moves.csv").write_text("time [s], hinge [rad/s]\n0, 0\n1, 1\n", encoding="utf-8")
    (tmp_path / "loads.csv").write_text("time [s], force_z [N]\n0, 0\n1, 1\n", encoding="utf-8")
    assert check(tmp_path, *deck).plan is not None
    text = changed("".join(deck), (written, misspelt))
    number = next(n for n, line in enumerate(text.splitlines(), 1) if misspelt in line)
    line = text.splitlines()[number - 1]
    word, meant = misspelt.split(" ")[0], written.split(" ")[0]
    margin = " " * len(str(number))
    helps = "".join(f"{margin} = help: {each}\n" for each in (f"did you mean `{meant}`?", *remedies))
    assert (
        messages(check(tmp_path, text))
        == f"""\
error[{code}]: {message}
{margin}--> deck.ic:{number}:{line.index(word) + 1}
{margin} |
{number} | {line}
{margin} | {" " * line.index(word)}{"^" * len(word)}
{helps}
1 error
"""
    )


def test_what_is_missing_besides_is_told(tmp_path: Path) -> None:
    joint = changed(ARM, ("parent = base; child = bar", "parnt = base"))
    assert (
        messages(check(tmp_path, joint, SERVO, RUN))
        == """\
error[D092]: joint `hinge` has no child
 --> deck.ic:3:5
  |
3 |     joint hinge revolute { parnt = base; axis = z; }
  |     ^^^^^^^^^^^^^^^^^^^^
  = help: write `child = LINK;`

error[D141]: joint `hinge` has no `parnt`
 --> deck.ic:3:28
  |
3 |     joint hinge revolute { parnt = base; axis = z; }
  |                            ^^^^^
  = help: did you mean `parent`?
  = help: it has: parent, child, at, rpy, axis, dh, q_min, q_max, qd_max, tau_max, follows, ratio, offset

2 errors
"""
    )


def test_it_is_told_beside_a_joint_that_is_not_there(tmp_path: Path) -> None:
    stop = "environment { wall = joint_stop { joint = hing; upper = 1 rad; stifness = 10 N*m/rad; } }"
    run = changed(RUN, ("duration", f"{stop}\n    duration"))
    assert (
        messages(check(tmp_path, ARM, SERVO, run))
        == """\
error[D159]: no joint `hing` in arm `swing`
  --> deck.ic:15:47
   |
15 |     environment { wall = joint_stop { joint = hing; upper = 1 rad; stifness = 10 N*m/rad; } }
   |                                               ^^^^
   = help: did you mean `hinge`?
   = help: joints: hinge

error[D141]: environment `wall` has no `stifness`
  --> deck.ic:15:68
   |
15 |     environment { wall = joint_stop { joint = hing; upper = 1 rad; stifness = 10 N*m/rad; } }
   |                                                                    ^^^^^^^^
   = help: did you mean `stiffness`?
   = help: it has: joint, lower, upper, stiffness, dissipation

2 errors
"""
    )


def test_a_word_like_nothing_is_taken_for_nothing(tmp_path: Path) -> None:
    servo = changed(SERVO, ("tau_max =", "strength ="))
    assert (
        messages(check(tmp_path, ARM, servo, RUN))
        == f"""\
error[D075]: servo `drive` has no `tau_max`
 --> deck.ic:5:1
  |
5 | servo drive {{
  | ^^^^^^^^^^^
  = help: write `tau_max = ... N*m;` (largest torque of the motor, before friction)

error[D141]: servo `drive` has no `strength`
 --> deck.ic:8:5
  |
8 |     strength = 1 N*m; j_m = 1e-4 kg*m^2;
  |     ^^^^^^^^
  = help: {OF_SERVO}

2 errors
"""
    )
