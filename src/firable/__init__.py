"""firable: check, prove, split and execute the extended Petri nets that control robotic cells."""

__version__ = "0.1.0"
