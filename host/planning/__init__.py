"""Planning: trajectories, the time laws, paths, motions and jobs that make them, and the planner that checks them."""
