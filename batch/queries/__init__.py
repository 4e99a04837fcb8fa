"""Questions to an archive: its cases, requirements and signals, in a form for display."""
