"""Tool and turntable from all captures together."""
