"""Statistics of cases: exact bounds on shares and percentiles, and tests that may be watched as cases come in."""
