"""What has to be proved of a decomposition, and proving it."""
