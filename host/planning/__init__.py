"""Planning: trajectories, their time laws, paths, motions and jobs, and the planner that checks them."""
