"""Sensors, guides, failures of servos, and motors on beds: everything that acts on the joints' servos."""
