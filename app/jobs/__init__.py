"""Jobs of worker processes on a task: plan, calibrate, edit, probe, and compile beforehand."""
