"""Where captures come from besides uploads."""
