"""Worlds of the simulated cell: rope, beans, cloth and liquids in engines that are not the model."""
