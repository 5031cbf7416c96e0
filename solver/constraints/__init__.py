"""Limits as rows of a nonlinear program, one family of geometry per file.

Every row knows its value, its derivative by the unknowns it touches and how to add its
curvature to a Hessian. Lengths are in units of the length scale of
:class:`solver.variables.Unknowns`.
"""
