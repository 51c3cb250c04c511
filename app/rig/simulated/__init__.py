"""The simulated cell: a MuJoCo world, an arm in a process of its own, and ray-cast RGB-D cameras."""
