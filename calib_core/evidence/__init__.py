"""Evidence: numbers as they are shown, and one renderer of blocks each for terminal and HTML.

The blocks themselves are records (`calib_core.records.evidence`); each stage makes its own in
`calib_core/stages/<name>/evidence.py`.  The page renders the same blocks in `web/blocks`.
"""
