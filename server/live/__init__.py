"""A live cell: devices that stay connected, and captures that are taken from them at standstill."""
