"""Kortex's services as messages: fields, calls, sessions and errors, without a connection."""
