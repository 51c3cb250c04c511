"""RealSense cameras behind the `Camera` port: one capture process a camera, with automatic recovery."""
