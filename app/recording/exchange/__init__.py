"""Files of other formats: plain arrays, LeRobot datasets, models and calibrations."""
