"""Decks of small arms, for tests of simulations."""

ARM = """\
#include <two_link.ic>

let load = 20 kg;

run reach like nominal {
    duration = 2 s;
    initial { elbow.q = 20 deg; }
    payload box { on = lower;  at = [2 m, 0 m, 0 m];  mass = load;  shape = sphere(radius = 0.1 m); }
    require volts < 4 V;
    allow D105 because "the rates are the paper's own";
}

sweep in_step of reach {
    zip { gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;  load = [10, 20, 30] kg; }
}

sweep each_with_each of reach {
    vary gearbox.kp = [0.01, 0.02, 0.03] V*s/rad;
    vary load = [10, 20] kg;
}
"""
"""The two-link arm with a payload whose mass is a `let`; its run `reach` is short."""

NOISY = """\
#include <two_link.ic>

run noisy like nominal {
    duration = 1 s;
    seed = 11;
    servos { shoulder = seeing;  elbow = gearbox; }
    allow D105 because "the rates are the paper's own";
}

servo seeing like gearbox { sensor qd = tachometer { noise = 0.001 rad/s; } }

sweep repeated of noisy {
    vary gearbox.kp = [0.01, 0.02] V*s/rad;
    repeat 3;
}
"""
"""The two-link arm whose shoulder has a noisy tachometer; a sweep with repeats."""
