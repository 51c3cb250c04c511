"""Parts that every tab is made of: the state of the console, cards, session keys, plots, colours."""
