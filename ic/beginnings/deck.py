"""The initial deck: an arm of two links under gravity, moved by two servos, with a sweep."""

from __future__ import annotations

DECK = """\
// $name.ic: an arm of two links, to begin from
//
//   met check $name.ic             what is wrong with it, if anything is
//   met run $name.ic               the run `lift` -> $name.h5, and a picture
//   met run $name.ic gains         the sweep, one case for each pair of values
//   met explain $name.ic elbow.servo.kp      where a value comes from
//   met fmt $name.ic               lays it out anew
//   met doc                       models there are; `met doc rigid_gearbox` says what one takes

deck 2;                                         // the edition of the language that this file is written in

let reach = 0.5 m;                              // a unit follows its number; a wrong one is an error

// Links have mass and inertia, joints say what hangs on what. z is up, because gravity says so below.
arm $name {
    link upper { mass = 4 kg;  shape = rod(length = reach, along = x); }
    link lower { mass = 2 kg;  shape = rod(length = reach, along = x); }

    joint shoulder revolute { parent = base;   child = upper;  axis = -y; }                            // up is positive
    joint elbow    revolute { parent = upper;  child = lower;  axis = -y;  at = [reach, 0 m, 0 m]; }   // of upper
}

// A motor with its gearbox and its computer. The numbers are assumptions: put those of your drive here.
servo drive {
    model      = rigid_gearbox;
    ratio      = 100;
    kp         = 0.1 V*s/rad;
    ki         = 2 V/rad;
    v_max      = 48 V;
    resistance = 0.5 ohm;
    kt         = 0.1 N*m/A;
    tau_max    = 1.2 N*m;
    j_m        = 6e-5 kg*m^2;
    f_c        = 0.01 N*m;                      // dry friction: the joint sticks
    k_position = 10 1/s;                        // a position command needs it
    command    = position(trapezoid(to = 30 deg, max_rate = 60 deg/s, max_acceleration = 90 deg/s^2));
}

// Everything that one simulation needs.
default run lift {
    arm    = $name;
    servos {
        shoulder = drive;
        elbow    = drive {
            command = position(trapezoid(to = 45 deg, max_rate = 60 deg/s, max_acceleration = 90 deg/s^2));
        }
    }
    initial     { q = 0 rad; }                  // straight out
    environment { gravity = [0, 0, -9.81] m/s^2; }
    rates       { dynamics = 1 kHz;  servos = 500 Hz;  record = 100 Hz; }
    duration    = 3 s;
    record      = [q, qd, tau, servo.voltage];  // `met doc channels` says what there is

    metric settle = settling_time { of = elbow.q;  target = 45 deg;  band = 0 %;  within = 1 deg; }
    metric effort = max           { of = shoulder.tau; }
    require settle < 2.5 s;                     // where a case misses it, `met run` exits with 1
}

sweep gains of lift {
    vary drive.kp         = [0.05, 0.1, 0.2] V*s/rad;           // of both servos
    vary links.lower.mass = [2, 3] kg;
}
"""
