"""What `import calib_core` gives a notebook or a program: sessions in memory, and one function a calibration."""
