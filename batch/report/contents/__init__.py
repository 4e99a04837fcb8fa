"""The contents of a report as plain data: `gathering.gather` makes a `parts.Report` from an archive."""
