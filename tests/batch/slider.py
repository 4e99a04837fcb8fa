"""A block on a spring without friction: the arm and the run of decks that search and tune."""

from __future__ import annotations

MASS, FAR = 2.0, 0.1
"""Of the block, kg, and how far from its rest it begins, m: after t it is at FAR cos(t sqrt(k/MASS))."""

ARM = f"""
arm slider {{
    link block {{ mass = {MASS} kg;  shape = sphere(radius = 0.1 m); }}
    joint slide prismatic {{ parent = base;  child = block;  axis = x; }}
}}
"""


def swing(*lines: str, record: str = "q") -> str:
    """The deck's arm, and its run `swing` of 1 s. lines: more of the run;  record: the signals that it keeps."""
    more = "".join(f"    {line}\n" for line in lines)
    return f"""{ARM}\
run swing {{
    arm = slider;
    initial {{ q = {FAR} m; }}
    environment {{ held = spring {{ link = block;  stiffness = 40 N/m; }} }}
    rates {{ dynamics = 200 Hz;  record = 10 Hz; }}
    duration = 1 s;
    record = [{record}];
{more}}}
"""
