"""Colours of the report's figures, the same in every one."""

BEFORE = "#e0812b"
AFTER = "#2f6fdb"
SKIN = "#cdb9ab"
BODY = "#8792a4"
LENS = "#20242c"
FIXED = "#9a7634"
GOOD_TO_BAD = "Viridis"
"""Sigma: dark is precise, bright is not; readable for the colour-blind and in print."""

VIEW_STEPS = (
    "#7f1d1d",
    "#c2410c",
    "#e9a23b",
    "#c7d36f",
    "#6cc08b",
    "#2f9e8f",
    "#1f6f8b",
    "#244a86",
)
"""Number of views 0, 1, 2 ... 7 and more."""
