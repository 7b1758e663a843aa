"""One visual language, one module a figure; matplotlib is imported here and nowhere else."""
