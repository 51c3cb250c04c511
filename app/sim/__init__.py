"""The differentiable particle simulator: Warp kernels behind JAX operations."""
