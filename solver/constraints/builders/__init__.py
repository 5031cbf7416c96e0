"""Which constraints the limits ask for: one builder per family of geometry."""
