"""The commands of `firable`: one file each; the only room that prints."""
