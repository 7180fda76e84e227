"""Running a cell: the tasks of a process, its trace, its situation, and the operator."""
