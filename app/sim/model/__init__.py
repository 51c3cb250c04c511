"""What is simulated: a scene, its parameters, and the catalogue of what a scene can have."""
