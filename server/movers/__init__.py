"""What moves a machine, apart from the sources, which only read: off unless an operator arms it for a session."""
