"""Programs for controllers that go through a planned set, a capture at each pose: one file a dialect."""
