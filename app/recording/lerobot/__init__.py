"""Recordings as a dataset in LeRobot's format v3.0: `dataset.export` writes one.

The format is described in https://huggingface.co/docs/lerobot/lerobot-dataset-v3. What stands in it here: the actions
of the arm, sampled evenly; what lies between them, while somebody looked and planned, is left out.
"""
