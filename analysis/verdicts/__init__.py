"""The verdicts of `check`: one file for each family of questions, asked of any state space."""
