"""Solvers by others, as scripts that `study throughput --peers` runs side by side with this one."""
