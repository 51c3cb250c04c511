"""Drawing of the report: markup, charts, maps and lenses, without a word of what they show."""
