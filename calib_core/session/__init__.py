"""A session's folder: reading, solving stage by stage, writing results."""
