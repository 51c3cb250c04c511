"""The operating system and the event loop: channels, processes, shared memory, threads."""
