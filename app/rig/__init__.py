"""Where frames come from and motions go: simulated, replayed or real."""
