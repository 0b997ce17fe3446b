"""The plane of laser light."""
