"""Long work in processes of its own: what runs it, and who keeps the books."""
