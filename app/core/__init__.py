"""The vocabulary of the program: messages, ports, channels, errors. Imports nothing else of `app`."""
