"""Calibrate cameras: print a board, check intrinsics, and solve for camera poses from images and gripper poses."""
