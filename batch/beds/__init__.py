"""The commands of `met bed`. `run` drives the cases of a run or sweep, one after another; the others come before it or
after a fault.

    running           `met bed run`
    executor          carries out a campaign's tasks, each case in a process of its own (hw/driving/case.py)
    case_result       a case's result from its records, at its end or after a crash; the records of all cases
    chosen_bed        the bed that a user means, for the commands below
    probe             `met bed probe` and `met bed clear`: who is there; forget latched faults
    flashing          `met bed firmware`: the image of a board (hw/boards/pico.py)
    jitter            `met bed jitter`: the timing of exchanges (hw/driving/jitter.py)
    identifying       `met bed identify`: a bed's parameters from guided moves (hw/identify)
    size              `met bed size`: what a bed's motors must do (bed_size, sizing), and the parts that can do it
"""
