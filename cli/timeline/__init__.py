"""What the trace of a run shows: from when to when each machine did what."""
