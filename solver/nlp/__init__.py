"""The nonlinear program of a frozen set of rays, and the SQP method that solves it.

:mod:`program` says what is to be minimised; :mod:`working_program` is its restriction to a
working set with slack variables; :mod:`penalty` weighs violations; :mod:`iterate` is where the
method stands between two steps; :mod:`quadratic` computes one step; :mod:`sqp` takes the steps.
"""
