"""Where to put lidars: what each place allows, which places are best, and why."""
