"""Sensors, guides, failures of servos, and motors on beds: whatever works upon the joints' servos."""
