"""From pictures to observations: which targets were seen, where, and how surely."""
