"""An example: a file format, an export and a source for scancell."""
