"""Files on one side, a `Site` on the other."""
