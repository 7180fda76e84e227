"""The far side: what drivers are tested against, and what a simulated cell is reached by."""
