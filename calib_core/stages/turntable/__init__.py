"""The turntable in the robot base."""
