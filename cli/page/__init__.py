"""The report as one page for a person: `page.py` puts it together, `sections.py` and `runs.py` hold its parts."""
