"""Reading of recordings: messages, timelines, films, clouds and marks."""
