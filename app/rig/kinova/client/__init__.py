"""Connections to a Kinova arm: our client and the official one behind the same link."""
