"""Runner, planner, register link and its transports."""
