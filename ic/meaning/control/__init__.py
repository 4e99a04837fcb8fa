"""Everything that acts in time on joints: servos, commands, sensors, guides, motors on beds, and their rates."""
