"""dipac: perceive, simulate, plan and act on deformable objects with differentiable particles."""

__version__ = "0.1.0"
