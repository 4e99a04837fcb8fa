"""A tree in general position, as the text of a deck: four joints that move, one of them prismatic, and a fixed one."""

from __future__ import annotations

GRAVITY = (0.7, -1.1, -9.6)

TREE = """\
arm tree {
    link trunk { mass = 6 kg;  com = [0.1, -0.05, 0.3] m;  inertia = [0.4, 0.5, 0.3, 0.02, -0.03, 0.01] kg*m^2; }
    link boom  { mass = 3 kg;  com = [0.4, 0.02, 0.03] m;  inertia = [0.1, 0.3, 0.35, 0.01, 0.02, 0.03] kg*m^2; }
    link ram   { mass = 2 kg;  com = [0.1, 0.1, -0.2] m;   inertia = [0.06, 0.05, 0.07, 0, 0.01, -0.01] kg*m^2; }
    link tool  { mass = 1 kg;  shape = sphere(radius = 8 cm);  com = [0.2, 0, 0.1] m; }
    link side  { mass = 4 kg;  shape = box(size = [0.2, 0.3, 0.5] m, along = z); }
    joint turn  revolute  { parent = base;  child = trunk;  axis = z;           at = [0.1, 0, 0.2] m;  rpy = [0.2, -0.1, 0.3] rad; }
    joint raise revolute  { parent = trunk; child = boom;   axis = [0, 3, 1];   at = [0.2, 0.1, 0.6] m; }
    joint push  prismatic { parent = boom;  child = ram;    axis = [2, 0, 1];   at = [0.7, 0, 0.1] m;  rpy = [0, 0.4, 0] rad; }
    joint hold  fixed     { parent = ram;   child = tool;   at = [0.1, 0.2, 0] m;  rpy = [0, 90, 0] deg; }
    joint wag   revolute  { parent = trunk; child = side;   axis = x;           at = [-0.3, 0, 0.5] m; }
}
"""  # noqa: E501 - a deck is as wide as it is
