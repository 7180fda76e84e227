"""The net model, its text format, PNML, diagnostics, the bundle format and the catalogue of example cells."""
