"""What may be written where: quantities of a deck, wanted in a unit, taken at pint's size or refused by dimension.

The contract: deg, rad and cycle are one dimension; Hz is 1/s without an angle, so a rate in Hz is no rate of turning.
The angle's exponent counts only where the rest is a power of time or nothing; elsewhere a radian counts as one.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.ic.small_decks import check, messages
from tests.met.test_units import PINT_NAMES
from tests.oracles.package import Package

pint = Package("pint")

DECK = """\
arm one {
    link bar  { mass = {mass}; inertia = [{inertia}, 0.02 kg*m^2, 0.02 kg*m^2]; }
    link tray { mass = 1 kg; shape = box(size = [{side}, 0.2 m, 0.1 m]); }
    joint hinge revolute { parent = base; child = bar; axis = z; rpy = [{turn}, 0 rad, 0 rad]; }
    joint slide prismatic { parent = bar; child = tray; axis = x; at = [{at}, 0 m, 0 m]; }
}
servo common {
    model = rigid_gearbox;
    kp = {kp}; ki = {ki}; v_max = {voltage}; resistance = {resistance}; kt = {kt};
    tau_max = {torque}; j_m = {rotor}; f_v = {friction}; k_position = {gain};
}
servo turning like common { ratio = {ratio}; command = rate(sine(amplitude = {rate}, frequency = {frequency})); }
servo pushing like common { ratio = {lead}; command = position({way}); }
run all {
    arm = one;
    servos { hinge = turning; slide = pushing; }
    initial { hinge.q = {angle}; slide.qd = {speed}; }
    environment {
        gravity = [0 m/s^2, 0 m/s^2, {gravity}];
        grease = joint_damping { damping = {damping}; }
        gust = wrench { link = bar; force = [{force}, 0 N, 0 N]; moment = [0 N*m, 0 N*m, {moment}]; until = {until}; }
    }
    rates { dynamics = {dynamics}; servos = 1 kHz; }
    duration = {duration};
    record = [];
    metric late = settling_time { of = hinge.qd; target = {target}; band = {band}; }
    require late < {limit};
}
"""

# place: the unit wanted, the plan's parameter (empty: none), what may be written there, and what may not
PLACES: dict[str, tuple[str, str, tuple[str, ...], tuple[str, ...]]] = {
    "mass": ("kg", "links.bar.mass", ("2 kg", "2000 g", "0.002 t", "2 N*s^2/m"), ("2", "2 N", "2 m", "2 kg*m")),
    "inertia": ("kg*m^2", "links.bar.inertia.xx", ("0.02 kg*m^2", "2e5 g*cm^2", "0.02 N*m*s^2", "0.02 N*m*s^2/rad"),
                ("0.02", "0.02 kg*m", "0.02 kg*m^3", "0.02 N*m")),
    "side": ("m", "", ("0.3 m", "30 cm", "300 mm", "0.3 m*rad"), ("0.3", "0.3 m^2", "0.3 s", "0.3 rad")),
    "turn": ("rad", "hinge.rpy.x", ("0.1 rad", "90 deg", "0.25 cycle", "100 mrad", "30 arcmin"),
             ("0.1", "0.1 rad/s", "0.1 m", "0.1 rad^2", "10 %")),
    "at": ("m", "slide.at.x", ("0.5 m", "50 cm", "(1/2) m", "3e5 um"), ("1/2 m", "0.5 rad", "1")),
    "kp": ("V*s/rad", "hinge.servo.kp",
           ("0.1 V*s/rad", "0.1 V*s", "0.1 N*m/A", "2 mV*s/deg", "0.01 V/rpm", "0.1 Pa*m^3/A", "0.1 V/(rad/s)"),
           ("0.1", "0.1 V/rad", "0.1 V*s^2", "0.1 V/A")),
    "ki": ("V/rad", "hinge.servo.ki", ("1 V/rad", "1 V", "20 mV/deg", "6 V/cycle", "1 W/A"),
           ("1", "1 V/s", "1 V*s/rad", "1 1/rad")),
    "voltage": ("V", "hinge.servo.v_max", ("24 V", "0.024 kV", "24 W/A", "24 N*m/(A*s)", "24 A*ohm"),
                ("24", "24 A", "24 V*s", "24 N")),
    "resistance": ("ohm", "hinge.servo.resistance", ("1 ohm", "1000 mohm", "1 V/A", "1 H/s", "1 s/F"),
                   ("1", "1 V", "1 H", "1 ohm*s")),
    "kt": ("N*m/A", "hinge.servo.kt", ("0.05 N*m/A", "0.05 V*s/rad", "0.05 V*s", "50 mN*m/A", "5 mV/rpm", "0.05 J/A"),
           ("0.05", "0.05 N*m", "0.05 N/A", "0.05 V/s")),
    "torque": ("N*m", "hinge.servo.tau_max", ("1 N*m", "1 J", "1 W*s", "1 N*m/rad", "1 kN*mm"),
               ("1", "1 N", "1 W", "1 N*m*s", "1 N*m^2")),
    "rotor": ("kg*m^2", "hinge.servo.j_m", ("1e-4 kg*m^2", "1000 g*cm^2", "1e-4 N*m*s^2/rad", "1e-4 J*s^2"),
              ("1e-4", "1e-4 kg", "1e-4 N*m*s")),
    "friction": ("N*m*s/rad", "hinge.servo.f_v",
                 ("1e-5 N*m*s/rad", "1e-5 N*m*s", "1e-5 J*s", "1e-6 N*m/rpm", "1e-5 kg*m^2/s"),
                 ("1e-5", "1e-5 N*m", "1e-5 N*m/s", "1e-5 N*s")),
    "gain": ("1/s", "hinge.servo.k_position", ("15 1/s", "15 s^-1", "15 Hz", "0.015 1/ms", "900 1/min"),
             ("15", "15 rad/s", "15 rpm", "15 s", "15 1/s^2")),
    "ratio": ("1", "hinge.servo.ratio", ("100", "100 rad/rad", "1000 %", "50 mm/mm", "36000 deg/cycle"),
              ("100 rad", "36 mm", "100 cycle", "100 1/s", "100 rad/m")),
    "lead": ("rad/m", "slide.servo.ratio", ("1 cycle / 5 mm", "0.1 cycle/mm", "600 rad/m", "600 1/m", "30 deg/mm"),
             ("600", "600 rad", "5 mm/cycle", "600 m")),
    "rate": ("rad/s", "hinge.servo.command.amplitude",
             ("0.1 rad/s", "6 deg/s", "1 rpm", "1 cycle/min", "0.1 mrad/ms", "0.1 rad*Hz", "360 deg/h"),
             ("0.1", "0.1 Hz", "0.1 1/s", "0.1 rad", "0.1 rad/s^2", "0.1 m/s", "0.1 rad^2/s", "0.1 rad*rpm")),
    "frequency": ("Hz", "hinge.servo.command.frequency", ("0.5 Hz", "0.5 1/s", "5e-4 kHz", "30 1/min"),
                  ("0.5", "0.5 cycle/s", "30 rpm", "3 rad/s", "0.5 s")),
    "way": ("m", "slide.servo.command.value", ("0.1 m", "100 mm", "10 cm", "0.1 m/rad"), ("0.1", "0.1 rad", "30 deg")),
    "angle": ("rad", "initial.hinge.q", ("0.1 rad", "6 deg", "0.1 cycle", "200 arcsec", "(6) deg"),
              ("0.1", "0.1 m", "6 deg/s", "6 deg^2", "2 %")),
    "speed": ("m/s", "initial.slide.qd", ("0.1 m/s", "36 km/h", "100 mm/s", "0.1 mm/ms", "0.1 m*Hz", "0.1 m*rad/s"),
              ("0.1", "0.1 rad/s", "0.1 m", "0.1 m/s^2")),
    "gravity": ("m/s^2", "environment.gravity.g.z", ("-9.81 m/s^2", "-9.81 N/kg", "-981 cm/s^2", "-9.81 m*Hz^2"),
                ("-9.81", "-9.81 m/s", "-9.81 N", "-9.81 rad/s^2")),
    "damping": ("N*m*s/rad", "environment.grease.damping",
                ("0.1 N*m*s/rad", "0.1 N*m*s", "0.01 N*m/rpm", "2 mN*m*s/deg"),
                ("0.1", "0.1 N*s/m", "0.1 N*m/rad")),
    "force": ("N", "environment.gust.force.x", ("5 N", "5000 mN", "0.005 kN", "5 kg*m/s^2", "5 J/m"),
              ("5", "5 kg", "5 N*m", "5 Pa")),
    "moment": ("N*m", "environment.gust.moment.z", ("5 N*m", "5 J", "5 N*m/rad", "5000 N*mm"), ("5", "5 N", "5 N*m/A")),
    "until": ("s", "environment.gust.until", ("0.5 s", "500 ms", "0.01 min", "0.5 1/Hz"),
              ("0.5", "0.5 Hz", "0.5 s*rad")),
    "dynamics": ("Hz", "", ("1000 Hz", "1 kHz", "1000 1/s", "1 1/ms"),
                 ("1000", "1000 rad/s", "60000 rpm", "1 ms", "1000 cycle/s", "1000 Hz^2")),
    "duration": ("s", "", ("1 s", "1000 ms", "0.05 min", "0.001 h", "1 1/Hz"),
                 ("1", "1 Hz", "1 m", "1 rad*s", "1 s^2")),
    "target": ("rad/s", "metrics.late.target", ("0.1 rad/s", "6 deg/s", "1 rpm"), ("0.1", "0.1 Hz", "0.1 rad")),
    "band": ("1", "metrics.late.band", ("2 %", "0.02", "0.02 rad/rad", "20 mm/m"), ("0.02 rad/s", "1 deg", "2 %/s")),
    "limit": ("s", "", ("1 s", "500 ms", "1 min"), ("1", "1 Hz", "1 rad", "1 m")),
}  # fmt: skip

TAKEN = [(place, written) for place, (_, _, good, _) in PLACES.items() for written in good]
REFUSED = [(place, written) for place, (_, _, _, bad) in PLACES.items() for written in bad]


@pytest.fixture(scope="module")
def registry() -> pint.UnitRegistry:
    return pint.UnitRegistry()


def deck(**written: str) -> str:
    """The deck with the first quantity of each place, but for these."""
    values = {place: good[0] for place, (_, _, good, _) in PLACES.items()} | written
    return re.sub(r"\{(\w+)\}", lambda match: values[match[1]], DECK)


def in_si(registry: pint.UnitRegistry, written: str) -> float:
    """What pint makes of a number and its unit, or of a quotient of two, `1 cycle / 5 mm`."""
    above, _, below = written.partition(" / ")
    if below:
        return in_si(registry, above) / in_si(registry, below)
    number, _, unit = written.partition(" ")
    named = re.sub(r"[A-Za-z]+|%", lambda match: PINT_NAMES.get(match[0], match[0]), unit or "1")
    size = (registry.Quantity(1.0) * registry.parse_expression(named)).to_base_units().magnitude
    return float(number.strip("()").replace("1/2", "0.5")) * float(size)


def test_the_tables_are_large_enough_to_mean_something() -> None:
    assert len(TAKEN) + len(REFUSED) >= 250


@pytest.mark.release
@pytest.mark.oracle
@pytest.mark.parametrize(("place", "written"), TAKEN)
def test_a_quantity_of_the_wanted_dimension_is_taken_at_pints_size(
    place: str, written: str, tmp_path: Path, registry: pint.UnitRegistry
) -> None:
    _, path, _, _ = PLACES[place]
    compiled = check(tmp_path, deck(**{place: written}))
    assert compiled.plan is not None, messages(compiled)
    (experiment,) = compiled.plan.experiments
    if path:
        # a unit's few factors, multiplied in another order
        assert experiment.parameters[path].value == pytest.approx(in_si(registry, written), rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(("place", "written"), REFUSED)
def test_a_quantity_of_another_dimension_is_refused_where_it_stands(place: str, written: str, tmp_path: Path) -> None:
    compiled = check(tmp_path, deck(**{place: written}))
    assert compiled.plan is None
    wrong = [each for each in compiled.diagnostics if each.severity == "error"]
    assert [each.code for each in wrong] in (["D060"], ["D061"]), messages(compiled)
    (at,) = (each.at for each in wrong)
    assert at is not None
    line = compiled.sources[at.place.file].splitlines()[at.place.line - 1]
    assert line[at.place.column - 1 :][: at.place.length] == written
