"""Linear answers about the program that runs: exact Jacobians over a period, poles, plants and margins of loops."""
