"""Where the cameras stand: a ChArUco board in the images, and the robot's poses beside them."""
