"""The object as particles: filled, resampled, and carried from view to view."""
