"""What is built: mounts, drawings, parts, printed wedges, and the plan that holds them."""
