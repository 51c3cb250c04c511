"""The operator console: shows messages, sends decisions, computes nothing."""
