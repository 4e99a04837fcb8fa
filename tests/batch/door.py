"""A leaf on a hinge with a handle, which a huge initial rate carries away."""

ARM = """
arm door {
    link leaf   { mass = 4 kg;  shape = rod(length = 1 m, along = x); }
    link handle { mass = 1 kg;  shape = rod(length = 0.2 m, along = x); }
    joint hinge revolute { parent = base;  child = leaf;  axis = z; }
    joint grip  revolute { parent = leaf;  child = handle;  axis = z;  at = [1, 0, 0] m; }
}
"""
