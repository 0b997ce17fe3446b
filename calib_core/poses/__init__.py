"""Robot poses: controllers' conventions, their numbers to base_from_tool0 and back, and whose pose it is."""
