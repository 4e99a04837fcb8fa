"""Motor substitution: one joint's motor is real, on a motor bed, or the emulated bed (docs/physics.md, section 6).

Everything here is on the motor's side of the gearbox: w is the shaft's rate, torques are the shaft's.
"""
