"""Where the cameras stand: print a board, check intrinsics, and find cameras from images and poses of the gripper."""
