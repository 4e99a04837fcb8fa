"""What a report holds, as plain data, gathered from an archive: `gathering.gather` makes a `parts.Report`."""
