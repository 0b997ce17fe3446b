"""The REST routes: parse, call, store."""
