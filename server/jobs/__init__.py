"""Solves and measurements in processes of their own."""
