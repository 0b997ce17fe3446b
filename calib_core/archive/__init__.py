"""Session folders and archives."""
