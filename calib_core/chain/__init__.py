"""The chain of frames: TCP, turntable, and all captures together."""
