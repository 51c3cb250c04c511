"""Clouds: depth to points, views fused, what is hidden remembered."""
