"""An arm that is not there: it answers on loopback as the firmware of a Gen3 does, and moves as its joints would."""
