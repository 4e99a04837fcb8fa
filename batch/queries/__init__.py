"""Questions to an archive: its cases, requirements and signals, as what shows them needs them."""
