"""The next action: pushes that tell the remaining causes apart."""
