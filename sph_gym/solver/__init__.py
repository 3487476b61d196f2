"""The solver: knows nothing of Gymnasium, files or pictures."""
