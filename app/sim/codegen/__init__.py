"""Code generation: the kernel functions of a scene, put together from its materials, tools and effects."""
