"""The material point method (MLS-MPM): transfers between particles and grid, each beside its adjoint."""
