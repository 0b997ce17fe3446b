"""Results for people, one renderer a medium."""
