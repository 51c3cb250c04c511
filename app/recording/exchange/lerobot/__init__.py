"""Recordings as a dataset in LeRobot's format v3.0: `dataset.export` writes one.

The format is described in https://huggingface.co/docs/lerobot/lerobot-dataset-v3. Its steps are the actions of the arm,
sampled evenly; the time between them, spent on observing and planning, is left out.
"""
