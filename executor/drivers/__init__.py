"""Drivers: the border between the executor and the machines."""
