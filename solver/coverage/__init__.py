"""Who sees what: visibility, required views, visibility cuts."""
