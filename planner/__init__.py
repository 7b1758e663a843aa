"""Decide, check, show and hand over a scanning lidar campaign."""
