"""RealSense cameras behind the `Camera` port: one capture process a camera, and what gets it going again."""
