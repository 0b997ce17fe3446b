"""A capture's bytes, and what was seen in them."""
