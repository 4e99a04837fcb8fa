"""The blocks of a deck about a run, a sweep, a search and a tuning."""

from __future__ import annotations

from collections.abc import Iterable

from ic.language.declaration import BlockDeclaration, Entry
from met.integrators import DEFAULT_INTEGRATOR, INTEGRATORS
from met.metrics import METRICS
from met.models import Model
from met.parameter import Parameter
from met.plan.run_keys import BALANCED, VELOCITY_PRODUCTS
from met.plan.searches import LEAST_MARGIN
from met.substitution import bed_scale

DURATION = Parameter(name="duration", unit="s", above=0.0, doc="length of the run")
SEED = Parameter(name="seed", at_least=0.0, at_most=2.0**53, doc="seed of the run's noise")
LINEAR_AT = Parameter(name="at", unit="s", at_least=0.0, doc="instant at which the run is linearised")
AT_MOST = Parameter(name="at_most", at_least=1.0, at_most=1e6, doc="largest number of cases of the search")
SEARCH_SEED = Parameter(name="seed", at_least=0.0, at_most=2.0**53, doc="seed of the search's random numbers")
MARGIN = Parameter(
    name="margin",
    default=0.05,
    at_least=0.0,
    at_most=1.0,
    doc="distance to each limit below which the goal is penalised, as a share of the limit",
)
LEAST_MARGIN_OF_TUNE = Parameter(
    name="least_margin",
    default=LEAST_MARGIN,
    at_least=0.0,
    below=2.0,
    doc="disk margin of the servo loops below which a design is not advised; 0: stability is not judged",
)
BASE_KINDS = ("fixed", "prescribed", "free")
SCALE_OF_INERTIA = Parameter(
    name="inertia",
    above=0.0,
    doc="inertia of the joint's motor divided by that of the bed's motor; it follows as torque/rate, and a written "
    "value is checked against that",
)
BED, LAW = "emulated", "velocity_tracking"
"""The models of a bed and of its law where a deck names none."""


def _names_of_models(models: Iterable[Model]) -> str:
    return ", ".join(f"`{model.name}`" for model in models)


def _rate(name: str, doc: str, default: str) -> Entry:
    """The entry of a rate in a run's block `rates`."""
    return Entry(
        name=name,
        written=f"{name} = 500 Hz;",
        default=default,
        varies="choice",
        path=f"rates.{name}",
        parameter=Parameter(name=name, unit="Hz", above=0.0, doc=doc),
        doc=doc,
    )


RATES = BlockDeclaration(
    name="rates",
    written="rates { ... }",
    within="run",
    head="rates",
    doc="The rates at which the parts of a run are computed. Each of them divides a common base rate.",
    entries=(
        _rate("dynamics", "integration steps of the arm's motion per second", "needed"),
        _rate("servos", "ticks per second of the servos that have no `rate` of their own, or `continuous`",
              "needed if there are such servos"),
        _rate("record", "recorded rows per second", "that of the dynamics"),
        _rate("base", "the common base rate, a whole multiple of every other rate", "the fastest of the others"),
    ),
)  # fmt: skip

INITIAL = BlockDeclaration(
    name="initial",
    written="initial { ... }",
    within="run",
    head="initial",
    called="the initial state",
    doc="The state of the arm at the start of the run.",
    entries=(
        Entry(name="q", written="q = 0 rad;", default="0", varies="number", path="initial.JOINT.q",
              doc="position of every joint, or of one, as in `swing.q = 5 deg;`; `q = command;` starts at the "
                  "position command"),
        Entry(name="qd", written="qd = 0 rad/s;", default="0", varies="number", path="initial.JOINT.qd",
              doc="rate of every joint, or of one, as in `swing.qd = 1 rad/s;`; `qd = command;` starts at the rate "
                  "of the command"),
        Entry.of_plan(BALANCED, "servos = balanced;"),
    ),
    free="`base.position`, `base.rpy`, `base.velocity` and `base.rate` of a free base",
)  # fmt: skip

ENVIRONMENT = BlockDeclaration(
    name="environment",
    written="environment { ... }",
    within="run",
    head="environment",
    called="the environment",
    doc="The models that act on the arm and its drives from outside, gravity among them.",
    entries=(
        Entry.of_plan(VELOCITY_PRODUCTS, "velocity_products = off;"),
    ),
    free="`NAME = MODEL { ... }` for any model of `met doc environments`; no model acts unless it is written",
)  # fmt: skip

SUBSTITUTE = BlockDeclaration(
    name="substitute",
    written="substitute JOINT { ... }",
    within="run",
    doc="Puts the motor of a joint on a motor bed. The servo stays as it is; the motion of its motor comes from the "
        "bed.",
    entries=(
        Entry(name="bed", written="bed = MODEL(...);", default=f"`{BED}`", varies="choice", path="JOINT.bed",
              doc="model of the motor bed (`met doc beds`)"),
        Entry(name="law", written="law = MODEL(...);", default=f"`{LAW}`", varies="choice", path="JOINT.law",
              doc="control law of the load motor, the same for all substituted joints of a run (`met doc laws`)"),
        Entry(name="scale", written="scale { ... }", default="1: both motors are of the same size",
              doc="ratios of the joint's motor to the motor on the bed (`met doc scale`)"),
    ),
)  # fmt: skip

SCALE = BlockDeclaration(
    name="scale",
    written="scale { ... }",
    within="substitute",
    head="",
    doc="The ratios of the joint's motor to the motor on the bed. They are pure numbers; time is not scaled.",
    entries=(
        *(
            Entry(name=parameter.name, written=f"{parameter.name} = {example};", default="1", varies="number",
                  path=f"JOINT.bed.scale.{parameter.name}", parameter=parameter, doc=parameter.doc)
            for parameter, example in zip(bed_scale.PARAMETERS, (25, 2, 10), strict=True)
        ),
        Entry(name="inertia", written="inertia = 12.5;", default="torque/rate", parameter=SCALE_OF_INERTIA,
              doc=SCALE_OF_INERTIA.doc),
    ),
)  # fmt: skip

METRIC = BlockDeclaration(
    name="metric",
    written="metric NAME = MODEL { of = EXPRESSION; ... }",
    within="run",
    head="metrics",
    doc="A number that summarises a case, computed from a signal.",
    entries=(
        Entry(
            name="of",
            written="of = swing.q;",
            path="",
            doc="the signal: a channel (`met doc channels`) or an expression of channels, such as `abs(swing.q - "
            "swing.servo.command)`; `*.q` is the channel of every joint; a condition for "
            + _names_of_models(metric for metric in METRICS if metric.condition),
        ),
    ),
    free="parameters of the model, one of `met doc metrics`; a figure of a linear analysis is `of` a `linear` block "
    "(`met doc linear`)",
)

LINEAR = BlockDeclaration(
    name="linear",
    written="linear NAME { at = TIME;  open = SIGNAL; ... }",
    within="run",
    called="linear answers",
    doc="A linear analysis of the running program at one instant: `met linear` prints it, and metrics can be figures "
        "of it.",
    entries=(
        Entry(name="at", written="at = 2 s;", default="0 s", parameter=LINEAR_AT,
              doc="the instant, moved back to the last start of a period; or `equilibrium(q = [30, -60] deg)`: the arm "
                  "stands still in this pose, without `q` in the pose at the start of the run"),
        Entry(name="inputs", written="inputs = pan.servo.command;", default="none",
              doc="columns of the matrix B: commands of servos that tick, and outputs of their control laws; one "
                  "name or a list"),
        Entry(name="outputs", written="outputs = [pan.q, tau];", default="none",
              doc="rows of the matrix C: any channels that can be recorded; one name or a list"),
        Entry(name="open", written="open = pan.servo.voltage;", default="none",
              doc="outputs of control laws at which loops are opened, each one alone and all at once; one name or a "
                  "list"),
    ),
)  # fmt: skip

TOLERANCES = BlockDeclaration(
    name="tolerances",
    written="tolerances { ... }",
    within="run",
    head="tolerances",
    doc="The differences between two versions that `met diff` accepts as equivalent.",
    entries=(
        Entry(name="rel", written="rel = 1e-9;", default="none: equal to the bit",
              doc="accepted difference of all signals and metrics, as a share of the value"),
        Entry(
        name="time",
        written="time = 1 ms;", default="none", doc="time by which a value of any signal may come earlier or later"),
    ),
    free="`NAME = SIZE;`, the accepted difference of a signal such as `qd`, of one joint's part of it such as "
    "`elbow.q`, or of a metric",
)  # fmt: skip

RUN = BlockDeclaration(
    name="run",
    written="run NAME { ... }",
    doc="Everything that one simulation needs.",
    entries=(
        Entry(name="arm", written="arm = NAME;", varies="choice", path="arm", doc="the arm that is simulated"),
        Entry(name="base", written="base = fixed;", default="`fixed`", varies="choice", path="base",
              doc="motion of the base: `fixed`, `free`, or `prescribed { ... }`"),
        Entry(name="servos", written="servos { JOINT = SERVO; }", default="none: joints without a servo move freely",
              varies="choice", path="JOINT.servo",
              doc="the servo of each joint; `SERVO { ... }` changes its parameters for this joint only"),
        Entry(name="guide", form="named", written="guide NAME = MODEL { ... }", default="none", path="guides.NAME",
              doc="a guide, which commands several joints together (`met doc guides`)"),
        Entry(name="substitute", form="named", written="substitute JOINT { ... }", default="none",
              doc="puts the motor of the joint on a motor bed (`met doc substitute`)"),
        Entry(name="sensor", form="named", written="sensor NAME = MODEL { ... }", default="none",
              path="sensors.NAME", doc="a sensor on a link (`met doc sensors`)"),
        Entry(name="payload", form="named", written="payload NAME { ... }", default="none", path="payloads.NAME",
              doc="a body that a link carries, grapples or releases (`met doc payload`)"),
        Entry(name="with", form="named", written="with PATH = VALUE;", default="none",
              doc="replaces the value of a path, as in `with links.boom.mass = 7 kg;`, or of a `param`, as in "
                  "`with reach = 1 m;`, for this run"),
        Entry(name="initial", written="initial { ... }", default="all 0, servos `unloaded`",
              doc="the state at the start: `q` and `qd` of all joints, or of one as in `swing.q = 5 deg;`, and "
                  "whether servos begin `balanced` (`met doc initial`)"),
        Entry(name="environment", written="environment { ... }", default="no gravity; velocity products on",
              doc="gravity, other models that act from outside, and `velocity_products` (`met doc environment`)"),
        Entry(name="rates", written="rates { ... }", default="`dynamics` is needed",
              doc="rates of the computation: `dynamics`, `servos`, `record`, `base` (`met doc rates`)"),
        Entry(name="integrator", written="integrator = NAME;", default=f"`{DEFAULT_INTEGRATOR.name}`", varies="choice",
              path="integrator",
              doc=f"method of integration: {_names_of_models(INTEGRATORS)} (`met doc integrators`)"),
        Entry(name="duration", written="duration = 3 s;", parameter=DURATION, varies="choice", path="duration",
              doc="length of the run, a whole number of steps of the dynamics"),
        Entry(name="record", written="record = [...];", default="needed; `[]` keeps metrics only",
              doc="channels whose signals are kept (`met doc channels`)"),
        Entry(name="signal", form="named", written="signal NAME = EXPRESSION;", default="none",
              doc="a signal that is computed from channels; records and metrics refer to it as `signals.NAME`"),
        Entry(name="metric", form="named", written="metric NAME = MODEL { ... }", default="none",
              path="metrics.NAME", doc="a number that summarises a case (`met doc metric`)"),
        Entry(name="linear", form="named", written="linear NAME { ... }", default="none",
              doc="a linear analysis at one instant, for requirements such as `require phase_margin(NAME) > 30 deg;` "
                  "(`met doc linear`)"),
        Entry(name="require", form="statement", written="require METRIC < LIMIT;", default="none",
              doc="a limit on a metric, with `<`, `<=`, `>` or `>=`; a missed limit makes the exit code 1. Also: a "
                  "share of cases, `METRIC < LIMIT in 99 % of cases with 90 % confidence`; the error by the step "
                  "length, `step_error(METRIC) < 1 %`; a condition over time, `always(CONDITION, after = 1 s)`; with "
                  "a name, `require NAME: ...;`"),
        Entry(name="allow", form="statement", written='allow CODE because "REASON";', default="none",
              doc="suppresses an expected warning, by the code that is printed with it: "
                  "`allow D105 because \"the report's own rates\";`"),
        Entry(name="tolerances", written="tolerances { ... }", default="none: equal to the bit",
              doc="differences between two versions that `met diff` accepts as equivalent (`met doc tolerances`)"),
        Entry(name="seed", written="seed = 7;", default="0", parameter=SEED, path="seed",
              doc="seed of the run's noise: that of sensors and of the tachometer of a motor bed"),
    ),
)  # fmt: skip

SWEEP = BlockDeclaration(
    name="sweep",
    written="sweep NAME of RUN { ... }",
    doc="The parameters of a run that vary. The cases are all combinations of the values on the axes.",
    entries=(
        Entry(name="vary", form="statement", written="vary PATH = LIST;", default="none",
              doc="an axis of one parameter: each value of the list is combined with the other axes"),
        Entry(name="zip", form="statement", written="zip { PATH = LIST;  PATH = LIST; }", default="none",
              doc="an axis of several parameters that vary together, each with a list of the same length"),
        Entry(name="from", form="statement", written='from "cases.csv";', default="none",
              doc="an axis of the rows of a CSV file, whose columns are parameters"),
        Entry(name="sample", form="statement", written="sample DESIGN(COUNT) { PATH = DISTRIBUTION; }",
              default="none",
              doc="an axis of values drawn at random (`met doc designs`); `random(until_shown, at_most = COUNT)` "
                  "runs no more cases than decide the requirements that have a confidence"),
        Entry(name="repeat", form="statement", written="repeat COUNT;", default="none",
              doc="runs each case this number of times, each time with different noise"),
        Entry(name="exclude when", form="statement", written="exclude when CONDITION;", default="none",
              doc="leaves out the cases for which the condition holds"),
        Entry(
        name="allow", form="statement", written='allow CODE because "REASON";', default="those that the run allows",
              doc="suppresses an expected warning, in addition to those that the run allows"),
        Entry(name="seed", written="seed = 7;", default="that of the run", parameter=SEED,
              doc="seed of the noise, and of the values that are drawn at random"),
        Entry(name="seeds", written="seeds = independent;", default="`common`",
              doc="`common`: all cases of a repeat have the same noise; `independent`: each case has noise of its own",
              parameter=Parameter(name="seeds", shape="word", words=("common", "independent"), default="common",
                                  doc="`common`: all cases of a repeat have the same noise; `independent`: each case "
                                      "has its own")),
    ),
)  # fmt: skip

_ALLOW = SWEEP["allow"]
_BUDGET = (
    Entry(name="at_most", written="at_most = 2000;", parameter=AT_MOST, doc="largest number of cases in all"),
    Entry(name="seed", written="seed = 3;", default="0", parameter=SEARCH_SEED,
          doc="seed of the search's random numbers; the noise of the run has a seed of its own"),
)  # fmt: skip

SEARCH = BlockDeclaration(
    name="search",
    written="search NAME of RUN { ... }",
    doc="A search for the worst case of a run. A case that fails counts as worse than any other.",
    entries=(
        Entry(name="maximise", form="statement", written="maximise METRIC;", default="needed, this or `minimise`",
              doc="searches for the case with the largest value of a metric"),
        Entry(name="minimise", form="statement", written="minimise METRIC;", default="needed, this or `maximise`",
              doc="searches for the case with the smallest value of a metric"),
        *_BUDGET,
        _ALLOW,
    ),
    free="`PATH = between(LOW, HIGH) UNIT;`, a parameter that the search chooses in this range; `logbetween` takes "
        "equal ratios as equal steps",
)  # fmt: skip

TUNE = BlockDeclaration(
    name="tune",
    written="tune NAME of RUN { ... }",
    doc="A search for the best parameters of a run: those that meet all requirements, and among these the best for a "
        "goal.",
    entries=(
        Entry(name="choose", form="statement", written="choose PATH = between(LOW, HIGH) UNIT;",
              doc="a parameter to tune, and its range; `logbetween` takes equal ratios as equal steps"),
        Entry(name="against", form="statement", written="against SWEEP;", default="the run itself",
              doc="a sweep of the same run; candidates are judged by the worst of its cases"),
        Entry(name="confirm", form="statement", written="confirm SWEEP;", default="none",
              doc="a sweep of the same run that draws what `against` varies: when the design is chosen, it is run with "
                  "these cases too, and the answer says how it came out"),
        Entry(name="minimise", form="statement", written="minimise METRIC;", default="needed, this or `maximise`",
              doc="the goal: the smallest value of a metric among the candidates that meet all requirements"),
        Entry(name="maximise", form="statement", written="maximise METRIC;", default="needed, this or `minimise`",
              doc="the goal: the largest value of a metric among the candidates that meet all requirements"),
        Entry(name="margin", written="margin = 5 %;", default="5 %", parameter=MARGIN,
              doc="distance to each limit, as a share of the limit, below which the goal counts as worse: at the "
                  "limit by the same share of the goal"),
        Entry(name="least_margin", written="least_margin = 0.5;", default="0.3", parameter=LEAST_MARGIN_OF_TUNE,
              doc="disk margin of the servo loops below which a design is not advised: 0.3 is 1.35 times the gain, "
                  "0.67 twice; a written one also steers the tuning; `0`: stability is not judged"),
        Entry(name="gradients", written="gradients = off;", default="`on`",
              doc="`on`: the tuning also takes steps along exact gradients of the metrics; `off`: it takes none",
              parameter=Parameter(name="gradients", shape="word", words=("on", "off"), default="on",
                                  doc="whether a tuning also takes steps along exact gradients of the metrics")),
        *_BUDGET,
        _ALLOW,
    ),
)  # fmt: skip
