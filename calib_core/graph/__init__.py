"""The graph of results: what a stage is, what it reads, its key, what is stale, and what its solver gets."""
