"""Checks of recordings, frames, limits and simulations before a verdict is believed."""
