"""The Kinova Gen3 at the wire: its protocol, two clients that speak it, and an emulator of the arm."""
