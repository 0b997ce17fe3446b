"""The commands of `scancell`: one file or folder each, found by listing.

Each has a constant `COMMAND`; what it needs is imported when it runs, so that `scancell --help` answers at once.
"""
