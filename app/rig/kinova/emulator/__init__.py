"""Emulator of a Gen3: it answers on loopback as the firmware does, and moves as the joints would."""
