"""A scene, its parameters, and the catalogue of materials, tools and effects that it can have."""
