"""Tree ensembles and small networks: evaluation in numpy and numba, and their files."""
