"""What is wrong with a session, and what has changed between two."""
