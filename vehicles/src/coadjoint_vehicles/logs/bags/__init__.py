"""Bags: logs as robots record them, messages of ROS in MCAP files, read and written."""
