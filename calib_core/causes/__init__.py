"""Root causes: hypotheses tried on a session that fails or is doubtful, and what would mend it."""
