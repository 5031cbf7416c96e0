"""The nonlinear programme of one working set, and the SQP method that solves it."""
