"""The blocks of a deck about a run, a sweep, a search and a tuning."""

from __future__ import annotations

from ic.language.declaration import BlockDeclaration, Entry
from met.parameter import Parameter
from met.plan import BALANCED, VELOCITY_PRODUCTS
from met.substitution import bed_scale

DURATION = Parameter(name="duration", unit="s", above=0.0, doc="length of the run")
SEED = Parameter(name="seed", at_least=0.0, at_most=2.0**53, doc="seed of the run's noise")
LINEAR_AT = Parameter(name="at", unit="s", at_least=0.0, doc="the instant of linear answers")
AT_MOST = Parameter(name="at_most", at_least=1.0, at_most=1e6, doc="cases of a search at most")
SEARCH_SEED = Parameter(name="seed", at_least=0.0, at_most=2.0**53, doc="seed of a search's own choices")
MARGIN = Parameter(
    name="margin", default=0.05, at_least=0.0, at_most=1.0, doc="share of each limit to stay away from it"
)
BASE_KINDS = ("fixed", "prescribed", "free")
SCALE_OF_INERTIA = Parameter(
    name="inertia", above=0.0, doc="follows from torque and rate; where it is written, it is held against them"
)
BED, LAW = "emulated", "velocity_tracking"
"""The models of a bed and of its law where a deck names none."""


def _rate(name: str, doc: str, default: str) -> Entry:
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
    doc="How often what is computed; each rate divides a common base rate.",
    entries=(
        _rate("dynamics", "steps of the arm's motion", "needed"),
        _rate("servos", "ticks of the servos that write no `rate` of their own, or `continuous`",
              "needed where there are such"),
        _rate("record", "recorded rows", "that of the dynamics"),
        _rate("base", "the common rate that all others divide", "the fastest of the others"),
    ),
)  # fmt: skip

INITIAL = BlockDeclaration(
    name="initial",
    written="initial { ... }",
    within="run",
    head="initial",
    called="the initial state",
    doc="The state at the start.",
    entries=(
        Entry(name="q", written="q = 0 rad;", default="0", varies="number", path="initial.JOINT.q",
              doc="position of every joint, or of one: `swing.q = 5 deg;` `q = command;`: where its command begins"),
        Entry(name="qd", written="qd = 0 rad/s;", default="0", varies="number", path="initial.JOINT.qd",
              doc="rate of every joint, or of one; `qd = command;`: that of its command"),
        Entry.of_plan(BALANCED, "servos = balanced;"),
    ),
    free="`base.position`, `base.rpy`, `base.velocity` and `base.rate` of a base that is free",
)  # fmt: skip

ENVIRONMENT = BlockDeclaration(
    name="environment",
    written="environment { ... }",
    within="run",
    head="environment",
    called="the environment",
    doc="What acts on the arm from outside.",
    entries=(
        Entry.of_plan(VELOCITY_PRODUCTS, "velocity_products = off;"),
    ),
    free="`NAME = MODEL { ... }`: models, `met doc environment`; none act unless they are written",
)  # fmt: skip

SUBSTITUTE = BlockDeclaration(
    name="substitute",
    written="substitute JOINT { ... }",
    within="run",
    doc="Puts the motor of a joint on a motor bed. The servo stays what it is; what its motor does is the bed's.",
    entries=(
        Entry(name="bed", written="bed = MODEL(...);", default=f"`{BED}`", varies="choice", path="JOINT.bed",
              doc="the model of the bed; `met doc beds`"),
        Entry(name="law", written="law = MODEL(...);", default=f"`{LAW}`", varies="choice", path="JOINT.law",
              doc="how the load motor is driven, one for all substituted joints; `met doc laws`"),
        Entry(name="scale", written="scale { ... }", default="1: the bed's motor is of the joint's size",
              doc="how many times larger the joint's motor is than the bed's"),
    ),
)  # fmt: skip

SCALE = BlockDeclaration(
    name="scale",
    written="scale { ... }",
    within="substitute",
    head="",
    doc="How many times larger the joint's motor is than the one on the bed. Pure numbers; time is not scaled.",
    entries=(
        *(
            Entry(name=each.name, written=f"{each.name} = {example};", default="1", varies="number",
                  path=f"JOINT.bed.scale.{each.name}", parameter=each, doc=each.doc)
            for each, example in zip(bed_scale.PARAMETERS, (25, 2, 10), strict=True)
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
    doc="One number of a case, of what it watches.",
    entries=(
        Entry(
            name="of",
            written="of = swing.q;",
            path="",
            doc="a channel, `met doc channels`, or an expression of some: `abs(swing.q - swing.servo.command)`; "
            "`*.q` is that of every joint; of `always` and its like a condition",
        ),
    ),
    free="parameters of the model: `met doc metric` lists the models; a figure of linear answers is `of` a "
    "`linear` block: `met doc linear`",
)

LINEAR = BlockDeclaration(
    name="linear",
    written="linear NAME { at = TIME;  open = SIGNAL; ... }",
    within="run",
    called="linear answers",
    doc="Linear answers about the program that runs, at an instant: `met linear` gives them, and metrics are figures "
    "of them.",
    entries=(
        Entry(name="at", written="at = 2 s;", default="0 s", parameter=LINEAR_AT,
              doc="the instant: the last begin of a period up to it counts; or `equilibrium(q = [30, -60] deg)`: "
                  "where the arm stands still in this pose, without `q` in that of the run's begin"),
        Entry(name="inputs", written="inputs = pan.servo.command;", default="none",
              doc="columns of B: commands of servos that tick, and what their laws put out; one, or a list"),
        Entry(name="outputs", written="outputs = [pan.q, tau];", default="none",
              doc="rows of C: whatever a record takes"),
        Entry(name="open", written="open = pan.servo.voltage;", default="none",
              doc="where loops are opened, at what laws put out: each by itself, and all at once"),
    ),
)  # fmt: skip

TOLERANCES = BlockDeclaration(
    name="tolerances",
    written="tolerances { ... }",
    within="run",
    head="tolerances",
    doc="By how much another version may differ before `met diff` says so.",
    entries=(
        Entry(name="rel", written="rel = 1e-9;", default="none: not in a bit", doc="a share of every value"),
        Entry(name="time", written="time = 1 ms;", default="none", doc="how much earlier or later"),
    ),
    free="`NAME = SIZE;` of a signal, `qd`, a joint's part of one, `elbow.q`, or a metric",
)  # fmt: skip

RUN = BlockDeclaration(
    name="run",
    written="run NAME { ... }",
    doc="Everything that one simulation needs.",
    entries=(
        Entry(name="arm", written="arm = NAME;", varies="choice", path="arm", doc="the arm"),
        Entry(name="base", written="base = fixed;", default="`fixed`", varies="choice", path="base",
              doc="`fixed`, `free`, or `prescribed { ... }`: how the base moves"),
        Entry(name="servos", written="servos { JOINT = SERVO; }", default="none: a joint without one is free",
              varies="choice", path="JOINT.servo",
              doc="servos on joints; `SERVO { ... }` overrides for this joint"),
        Entry(name="guide", form="named", written="guide NAME = MODEL { ... }", default="none", path="guides.NAME",
              doc="commands several joints together"),
        Entry(name="substitute", form="named", written="substitute JOINT { ... }", default="none",
              doc="puts the joint's motor on a motor bed"),
        Entry(name="sensor", form="named", written="sensor NAME = MODEL { ... }", default="none",
              path="sensors.NAME", doc="a sensor on a link"),
        Entry(name="payload", form="named", written="payload NAME { ... }", default="none", path="payloads.NAME",
              doc="a body that a link carries, grapples or releases"),
        Entry(name="with", form="named", written="with PATH = VALUE;", default="none",
              doc="a value in place of what is written elsewhere, by its path: `with links.boom.mass = 7 kg;` "
                  "or of a `param`: `with reach = 1 m;`"),
        Entry(name="initial", written="initial { ... }", default="0, `unloaded`",
              doc="`q` and `qd` of all joints or one: `swing.q = 5 deg;` whether servos begin `balanced`"),
        Entry(name="environment", written="environment { ... }", default="no gravity; velocity products on",
              doc="gravity, models, `velocity_products`"),
        Entry(name="rates", written="rates { ... }", default="`dynamics` is needed",
              doc="`dynamics`, `servos`, `record`, `base`"),
        Entry(name="integrator", written="integrator = NAME;", default="`modified_euler`", varies="choice",
              path="integrator", doc="`modified_euler`, `midpoint`, `semi_implicit_euler`, `rk4`"),
        Entry(name="duration", written="duration = 3 s;", parameter=DURATION, varies="choice", path="duration",
              doc="a whole number of steps of the dynamics"),
        Entry(name="record", written="record = [...];", default="needed; `[]` keeps metrics alone",
              doc="channels to keep"),
        Entry(name="signal", form="named", written="signal NAME = EXPRESSION;", default="none",
              doc="a number computed of channels; a record and a metric call it `signals.NAME`"),
        Entry(name="metric", form="named", written="metric NAME = MODEL { ... }", default="none",
              path="metrics.NAME", doc="one number of a case"),
        Entry(name="linear", form="named", written="linear NAME { ... }", default="none",
              doc="linear answers at an instant, by name: `require phase_margin(NAME) > 30 deg;`"),
        Entry(name="require", form="statement", written="require METRIC < LIMIT;", default="none",
              doc="a limit that counts for the exit code; also `<=`, `>`, `>=`; of a share of cases: "
                  "`in 99 % of cases with 90 % confidence`; "
                  "`step_error(METRIC) < 1 %` is one on its error by the step; over time: "
                  "`always(CONDITION, after = 1 s)`; with a name: `require NAME: ...;`"),
        Entry(name="allow", form="statement", written='allow CODE because "REASON";', default="none",
              doc="a warning that is right, and not to be given; its code is printed with it: "
                  "`allow D105 because \"the report's own rates\";`"),
        Entry(name="tolerances", written="tolerances { ... }", default="none: not in a bit",
              doc="by how much another version may differ before `met diff` says so"),
        Entry(name="seed", written="seed = 7;", default="0", parameter=SEED, path="seed",
              doc="seed of the run's noise, which sensors and a bed's tachometer have"),
    ),
)  # fmt: skip

SWEEP = BlockDeclaration(
    name="sweep",
    written="sweep NAME of RUN { ... }",
    doc="What of a run varies. The cases are the product of its axes.",
    entries=(
        Entry(name="vary", form="statement", written="vary PATH = LIST;", default="none",
              doc="an axis: one case or more for each value"),
        Entry(name="zip", form="statement", written="zip { PATH = LIST;  PATH = LIST; }", default="none",
              doc="an axis of several parameters in step, as many values each"),
        Entry(name="from", form="statement", written='from "cases.csv";', default="none",
              doc="an axis of the rows of a file"),
        Entry(name="sample", form="statement", written="sample DESIGN(COUNT) { PATH = DISTRIBUTION; }",
              default="none", doc="an axis of values drawn at random; `random(until_shown, at_most = COUNT)`: no more "
                  "cases than decide the requirements with a confidence"),
        Entry(name="repeat", form="statement", written="repeat COUNT;", default="none",
              doc="each case so many times, with noise of its own"),
        Entry(name="exclude when", form="statement", written="exclude when CONDITION;", default="none",
              doc="leaves out the cases for which it holds"),
        Entry(name="allow", form="statement", written='allow CODE because "REASON";', default="those of the run",
              doc="a warning that is not to be given, beside those that the run allows"),
        Entry(name="seed", written="seed = 7;", default="the run's", parameter=SEED,
              doc="of the noise, and of what is drawn"),
        Entry(name="seeds", written="seeds = independent;", default="`common`",
              doc="each case has noise of its own, not that of its position alone",
              parameter=Parameter(name="seeds", shape="word", words=("common", "independent"), default="common",
                                  doc="whether each case has noise of its own")),
    ),
)  # fmt: skip

_ALLOW = SWEEP["allow"]
_BUDGET = (
    Entry(name="at_most", written="at_most = 2000;", parameter=AT_MOST, doc="cases in all"),
    Entry(name="seed", written="seed = 3;", default="0", parameter=SEARCH_SEED,
          doc="of what is tried; the run's noise has its own"),
)  # fmt: skip

SEARCH = BlockDeclaration(
    name="search",
    written="search NAME of RUN { ... }",
    doc="Looks for the case that hurts most; one that fails hurts most of all.",
    entries=(
        Entry(name="maximise", form="statement", written="maximise METRIC;", default="needed, this or `minimise`",
              doc="looks for the case with the largest value of a metric"),
        Entry(name="minimise", form="statement", written="minimise METRIC;", default="needed, this or `maximise`",
              doc="looks for the case with the least value of a metric"),
        *_BUDGET,
        _ALLOW,
    ),
    free="`PATH = between(LOW, HIGH) UNIT;`, a parameter that is chosen; `logbetween`: by equal ratios, not steps",
)  # fmt: skip

TUNE = BlockDeclaration(
    name="tune",
    written="tune NAME of RUN { ... }",
    doc="Looks for the parameters that serve best: all requirements of the run met, and then a goal.",
    entries=(
        Entry(name="choose", form="statement", written="choose PATH = between(LOW, HIGH) UNIT;",
              doc="a parameter that is tuned; `logbetween` where equal ratios are equal steps"),
        Entry(name="against", form="statement", written="against SWEEP;", default="the run as it is",
              doc="a sweep of the same run: the worst of its cases counts"),
        Entry(name="minimise", form="statement", written="minimise METRIC;", default="needed, this or `maximise`",
              doc="the goal among those that meet all requirements"),
        Entry(name="maximise", form="statement", written="maximise METRIC;", default="needed, this or `minimise`",
              doc="likewise, the largest"),
        Entry(name="margin", written="margin = 5 %;", default="5 %", parameter=MARGIN,
              doc="a distance to each limit, as a share of it, that is worth as large a share of the goal"),
        Entry(name="gradients", written="gradients = off;", default="`on`",
              doc="takes no steps along exact slopes of the metrics",
              parameter=Parameter(name="gradients", shape="word", words=("on", "off"), default="on",
                                  doc="whether a tuning takes steps along exact slopes")),
        *_BUDGET,
        _ALLOW,
    ),
)  # fmt: skip
