"""What the commands share: their form, common arguments, output and progress."""
