"""Dense reconstruction: from the pictures of one capture to points with their sigma."""
