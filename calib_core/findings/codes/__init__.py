"""The codes, one module an area; severity stands here and nowhere else."""
