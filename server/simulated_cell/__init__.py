"""The simulated cell over the protocols of real devices, for trying and testing live sources."""
