"""Evidence: what a verdict rests on, as a document of its own, and the checker that trusts nobody who wrote one."""
