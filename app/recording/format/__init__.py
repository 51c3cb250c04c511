"""The format of recordings: channels and schemas, codecs, epochs, digests, integrity and migration."""
