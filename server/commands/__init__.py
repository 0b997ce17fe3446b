"""What the commands of `scancell` do; `server/cli.py` has their arguments."""
