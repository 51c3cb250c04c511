"""Camera calibration: hand-eye calibration from a ChArUco board in the images and the robot's poses beside them."""
