"""The RealSense SDK and what stands in for its devices: software devices, rendered and synthetic sources."""
