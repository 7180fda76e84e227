"""Making evidence from the run that decided: trusted for nothing, since all of it is checked."""
