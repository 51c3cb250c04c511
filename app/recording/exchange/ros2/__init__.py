"""Bags of ROS 2 (rosbag2): MCAP or SQLite, messages in CDR."""
