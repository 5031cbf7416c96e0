"""Studies: many rigs designed over a grid of choices, and what they say together."""
