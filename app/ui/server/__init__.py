"""The console's server: its page, who may open it, and the proxy in front of viser."""
