"""Parts that every tab is made of: the board of the latest messages, cards, badges, plots, colours."""
