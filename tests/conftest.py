"""Properties are tested with the same examples every time, and take the time that a busy machine gives them."""

from hypothesis import settings

settings.register_profile("scancell", deadline=None, derandomize=True, database=None)
settings.load_profile("scancell")
