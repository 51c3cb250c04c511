"""MCAP files: one an episode, crash-safe, in schemas that Foxglove displays directly.

`writer.open_recording` writes one, `studio.open_studio` demonstrations and clips beside it; `reader.read_messages`
gives the messages back, `recover.recover` salvages a file that a crash cut off. The format is described in
docs/recording-format.md.
"""
