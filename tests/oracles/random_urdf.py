"""Random robots as URDF text, from a seed: branches, slides, wheels, turned frames of inertia, links without mass."""

from __future__ import annotations

import numpy as np


def random_urdf(seed: int) -> str:
    """1 to 9 joints; names with dashes and dots; axes of any length; a tool without mass on every other part, and yokes
    without mass between joints that turn."""
    rng = np.random.default_rng(seed)

    def vector(size: float) -> str:
        return " ".join(repr(float(x)) for x in rng.uniform(-size, size, 3))

    def origin(size: float, turn: float) -> str:
        return f'<origin xyz="{vector(size)}" rpy="{vector(turn)}"/>' if rng.random() < 0.9 else ""

    def link(name: str) -> str:
        a, b, c = np.sort(rng.uniform(0.5, 1.0, 3)) * rng.uniform(0.01, 0.5)
        R = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        J = R @ np.diag([b, c, min(c + b, a + c) * 0.9]) @ R.T
        moments = " ".join(f'i{n}="{float(J["xyz".index(n[0]), "xyz".index(n[1])])!r}"'
                           for n in ("xx", "xy", "xz", "yy", "yz", "zz"))  # fmt: skip
        return (f'<link name="{name}"><inertial>{origin(0.3, 3.0)}<mass value="{rng.uniform(0.1, 5.0)!r}"/>'
                f"<inertia {moments}/></inertial></link>")  # fmt: skip

    links, joints = ['<link name="the ground"/>'], []
    names = ["the ground"]
    for i in range(int(rng.integers(1, 10))):
        name, parent = f"part-{i}.x", names[int(rng.integers(max(0, len(names) - 3), len(names)))]
        kinds = ["revolute", "continuous", "prismatic", "fixed"]
        kind = str(rng.choice(kinds, p=[0.4, 0.2, 0.25, 0.15])) if i else "revolute"
        limit = '<limit lower="-1" upper="1" effort="1" velocity="1"/>' if kind in ("revolute", "prismatic") else ""
        axis = f'<axis xyz="{vector(2.0)}"/>' if rng.random() < 0.8 else ""
        if kind == "revolute" and rng.random() < 0.3:
            links.append(f'<link name="yoke{i}"/>')
            joints.append(f'<joint name="yoke{i}" type="revolute">{origin(0.5, 3.0)}<parent link="{parent}"/>'
                          f'<child link="yoke{i}"/><axis xyz="{vector(2.0)}"/>{limit}</joint>')  # fmt: skip
            parent = f"yoke{i}"
        links.append(link(name))
        joints.append(f'<joint name="to {name}" type="{kind}">{origin(0.5, 3.0)}<parent link="{parent}"/>'
                      f'<child link="{name}"/>{axis}{limit}</joint>')  # fmt: skip
        names.append(name)
        if i % 2:
            links.append(f'<link name="tool{i}"/>')
            joints.append(f'<joint name="tool{i}" type="fixed">{origin(0.5, 3.0)}<parent link="{name}"/>'
                          f'<child link="tool{i}"/></joint>')  # fmt: skip
    return '<robot name="random">\n' + "\n".join([*links, *joints]) + "\n</robot>\n"
