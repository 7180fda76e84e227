"""The simulated cell: machines, stations and workpieces, and a clock that jumps."""
