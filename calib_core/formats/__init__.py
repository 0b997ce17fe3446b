"""Files that scanners and programs write: one module a format."""
