"""The sphere in one scan: from a cloud, and from one profile."""
