"""Questions in temporal logic, asked of any state space: CTL, LTL, bounds, and what the contest asks besides."""
