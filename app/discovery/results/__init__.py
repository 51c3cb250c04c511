"""Verdict, case and gain, and their wording."""
