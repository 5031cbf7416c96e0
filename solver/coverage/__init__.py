"""Who sees what: rays cast, views assigned to cameras, cuts that keep hidden points in view."""
